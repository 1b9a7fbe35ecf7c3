# A humanoid steered by motet's live server: motet live --port 8765 (docs/reference/live-protocol.md has the protocol).
# Put it on the node above the skeleton, whose bones have the names of Godot's
# SkeletonProfileHumanoid and rest in a T-pose that faces z, as the importer makes them.
extends Node3D

@export var skeleton: Skeleton3D
@export var url := "ws://127.0.0.1:8765"
@export var speed := 1.3  # metres a second of a stick that is pushed all the way

var socket := WebSocketPeer.new()
var names: Array  # of motet's bones, parents first
var parents := {}  # bone -> its parent, "" for the hips
var size := 1.0  # of this figure, motet's is 1
var stick := Vector2.ZERO


func _ready() -> void:
	socket.connect_to_url(url)


func _process(_delta: float) -> void:
	socket.poll()
	while socket.get_available_packet_count() > 0:
		var text := socket.get_packet().get_string_from_utf8()
		var message: Dictionary = JSON.parse_string(text)
		match message.type:
			"hello": meet(message)
			"frame": pose(message.characters[0])
			_: push_warning(message.message)  # a note, or why the server hangs up
	var now := Input.get_vector("ui_left", "ui_right", "ui_up", "ui_down") * speed
	if socket.get_ready_state() == WebSocketPeer.STATE_OPEN and now != stick:
		stick = now
		socket.send_text(JSON.stringify({"type": "control", "velocity": [stick.x, stick.y]}))


func meet(hello: Dictionary) -> void:
	names = hello.bones
	for joint in hello.joints:
		parents[joint.name] = hello.joints[joint.parent].name if joint.parent >= 0 else ""
	var hips := skeleton.get_bone_global_rest(skeleton.find_bone("Hips"))
	size = hips.origin.y / hello.joints[0].offset[1]


func pose(figure: Dictionary) -> void:
	position = vector(figure.position) * size
	quaternion = turn(figure.rotation)
	var turns := {"": Quaternion.IDENTITY}  # of bones, from the frame of the figure
	for i in names.size():
		turns[names[i]] = turns[parents[names[i]]] * turn(figure.rotations[i])
		var bone := skeleton.find_bone(names[i][0].to_upper() + names[i].substr(1))
		if bone < 0:
			continue
		var above := skeleton.get_bone_parent(bone)
		var around := skeleton.get_bone_global_pose(above) if above >= 0 else Transform3D.IDENTITY
		var rest := skeleton.get_bone_global_rest(bone).basis.get_rotation_quaternion()
		var from := around.basis.get_rotation_quaternion().inverse()
		skeleton.set_bone_pose_rotation(bone, from * turns[names[i]] * rest)
		if i == 0:
			var hips := Vector3(0, figure.height * size, 0)
			skeleton.set_bone_pose_position(bone, around.affine_inverse() * hips)


func vector(v: Array) -> Vector3:
	return Vector3(v[0], v[1], v[2])


func turn(q: Array) -> Quaternion:
	return Quaternion(q[0], q[1], q[2], q[3]).normalized()
