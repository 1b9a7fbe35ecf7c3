/* three.js and three-vrm play the clips, and joints go where they do in the motion. */
import { type VRMHumanBones, VRMHumanoid } from "@pixiv/three-vrm";
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import test from "node:test";
import * as THREE from "three";
import {
  fromHumanoid,
  HUMANOID,
  type Motion,
  MotionError,
  readBVH,
  readGLB,
  toHumanoid,
  toThree,
  worldOf,
} from "../src/index.js";

const { figures, scenes } = JSON.parse(readFileSync("tests/cases.json", "utf8"));
const file: Motion = readBVH(figures.walk.text);
const { motion: walk } = toHumanoid(file);

/** A node for each joint at its place in the T-pose, with a rest rotation of its own, scaled and facing z or -z. */
function figure(scale: number, backwards: boolean): THREE.Object3D[] {
  const nodes = HUMANOID.joints.map(({ name }) =>
    Object.assign(new THREE.Object3D(), { name: `raw_${name}` }),
  );
  HUMANOID.joints.forEach(({ parent }, at) => {
    const [x, y, z] = HUMANOID.rest[at]!.map(
      (value, axis) => scale * (value + (axis === 1 ? HUMANOID.joints[0]!.offset[1] : 0)),
    ) as [number, number, number];
    nodes[at]!.position.set(backwards ? -x : x, y, backwards ? -z : z);
    nodes[at]!.quaternion.set(Math.sin(at), Math.cos(2 * at), 0.3, 1).normalize();
    nodes[at]!.updateMatrixWorld();
    if (parent >= 0) nodes[parent]!.attach(nodes[at]!);
  });
  return nodes;
}

function playedAt(clip: object, root: THREE.Object3D, seconds: number): void {
  const mixer = new THREE.AnimationMixer(root);
  mixer
    .clipAction(THREE.AnimationClip.parse(clip as never))
    .setLoop(THREE.LoopOnce, 1)
    .play();
  mixer.setTime(seconds);
}

function assertAt(nodes: THREE.Object3D[], wanted: number[][], scale: number, sign = 1): void {
  nodes.forEach((node, at) => {
    const found = node.getWorldPosition(new THREE.Vector3()).toArray();
    found.forEach((value, axis) => {
      const goal = wanted[at]![axis]! * scale * (axis === 1 ? 1 : sign);
      assert.ok(Math.abs(value - goal) < 1e-4 * scale, `${node.name}: ${found}, not ${wanted[at]}`);
    });
  });
}

for (const [metaVersion, scale] of [
  ["1", 1],
  ["0", 0.5],
] as const) {
  test(`a VRM avatar of version ${metaVersion} walks as the motion does, with its own rest rotations and size`, () => {
    const nodes = figure(scale, metaVersion === "0");
    const bones = Object.fromEntries(
      HUMANOID.names
        .filter((name) => !name.endsWith("_end"))
        .map((name) => [name, { node: nodes[HUMANOID.index(name)] }]),
    );
    const humanoid = new VRMHumanoid(bones as unknown as VRMHumanBones);
    const scene = new THREE.Group().add(nodes[0]!, humanoid.normalizedHumanBonesRoot);
    const clip = toThree(walk, { humanoid, meta: { metaVersion } } as never);
    for (const frame of [0, 7, 20]) {
      playedAt(clip, scene, frame / walk.fps);
      humanoid.update();
      scene.updateMatrixWorld(true);
      assertAt(nodes, worldOf(walk).places[frame]!, scale, metaVersion === "0" ? -1 : 1);
    }
  });
}

test("a clip of a figure's own joints moves a skeleton of their names", () => {
  const own = fromHumanoid(walk, file);
  const nodes = own.skeleton.joints.map(({ name, offset }) => {
    const node = new THREE.Bone();
    node.name = THREE.PropertyBinding.sanitizeNodeName(name);
    node.position.set(...offset);
    return node;
  });
  own.skeleton.joints.forEach(({ parent }, at) => parent >= 0 && nodes[parent]!.add(nodes[at]!));
  playedAt(toThree(own), nodes[0]!, 9 / own.fps);
  nodes[0]!.updateMatrixWorld(true);
  const metres = worldOf(own).places[9]!.map((place) => place.map((value) => value / 100));
  assertAt(nodes, metres, 100); // the file is in centimetres
});

for (const name of ["moving.glb", "avatar.vrm"]) {
  test(`a clip for the nodes of ${name} moves them, below their scale and turn`, () => {
    const content = new Uint8Array(Buffer.from(scenes[name].base64, "base64"));
    const { nodes } = JSON.parse(
      new TextDecoder().decode(content.subarray(20, 20 + new DataView(content.buffer).getUint32(12, true))),
    );
    const objects = nodes.map((node: any) => {
      const object = Object.assign(new THREE.Object3D(), {
        name: THREE.PropertyBinding.sanitizeNodeName(node.name),
      });
      object.position.fromArray(node.translation ?? [0, 0, 0]);
      object.quaternion.fromArray(node.rotation ?? [0, 0, 0, 1]);
      object.scale.fromArray(node.scale ?? [1, 1, 1]);
      return object;
    }) as THREE.Object3D[];
    nodes.forEach((node: any, at: number) =>
      (node.children ?? []).forEach((child: number) => objects[at]!.add(objects[child]!)),
    );
    const character = readGLB(content);
    for (const own of [character, fromHumanoid(walk, character, { ahead: true })]) {
      playedAt(toThree(own), objects[0]!, 5 / own.fps);
      objects[0]!.updateMatrixWorld(true);
      const joints = own.skeleton.nodes!.map((node) =>
        objects.find((object) => object.name === THREE.PropertyBinding.sanitizeNodeName(node.name))!,
      );
      assertAt(joints, worldOf(own).places[5]!, 1);
    }
  });
}

test("an avatar without hips is refused", () => {
  const avatar = {
    meta: { metaVersion: "1" },
    humanoid: { getNormalizedBoneNode: () => null, normalizedRestPose: {} },
  };
  assert.throws(() => toThree(walk, avatar), MotionError);
});
