/* Written by runtime/web/generate.py from the modules of the Python runtime: do not edit. */

// motet.bundle.bundle
export const BUNDLE = {
  // Bytes; as JSON objects in memory they can be twenty times as many.
  MAX_MANIFEST: 4194304,
} as const;

// motet.bundle.fields
export const FIELDS = {
  // Of any number: what is larger is an error, and would overflow in float32 soon.
  LARGEST: 1000000000,
} as const;

// motet.bundle.graph_safety
export const GRAPH_SAFETY = {
  // Fields of a whole graph, bytes of a field that is no tensor's data, and messages within each other.
  MAX_FIELDS: 100000,
  MAX_DEPTH: 64,
  // The fields of onnx.proto by number. Types of values (fields 11 to 13 of a graph, 14 and 15 of an attribute) and annotations hold neither tensors nor nodes.
  MESSAGES: { model: { plain: [1, 2, 3, 4, 5, 6, 14], nested: { 7: "graph", 8: "opset" }, name: 0, domain: 0 }, opset: { plain: [1, 2], nested: {  }, name: 0, domain: 1 }, graph: { plain: [2, 10, 11, 12, 13, 14, 16], nested: { 1: "node", 5: "tensor", 15: "sparse" }, name: 2, domain: 0 }, node: { plain: [1, 2, 3, 4, 6, 7, 8, 9], nested: { 5: "attribute" }, name: 3, domain: 7 }, attribute: { plain: [1, 2, 3, 4, 7, 8, 9, 13, 14, 15, 20], nested: { 5: "tensor", 6: "graph", 10: "tensor", 11: "graph", 22: "sparse", 23: "sparse" }, name: 1, domain: 0 }, sparse: { plain: [3], nested: { 1: "tensor", 2: "tensor" }, name: 0, domain: 0 }, tensor: { plain: [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 16], nested: {  }, name: 8, domain: 0 } },
} as const;

// motet.bundle.manifest
export const MANIFEST = {
  // Version of the bundle format that this motet writes and reads.
  FORMAT: 3,
} as const;

// motet.bundle.members
export const MEMBERS = {
  // Files of a bundle, and bytes of all of them together.
  MAX_FILES: 64,
  MAX_SIZE: 268435456,
} as const;

// motet.decode.beam.ConsensusSettings
export const consensusSettings = {
  max_words: { default: null, low: 1, high: 1000, whole: true },
  beams: { default: 5, low: 1, high: 100, whole: true },
  draws: { default: 100, low: 1, high: 1000, whole: true },
  temperature: { default: 1, low: 0.01, high: 100, whole: false },
} as const;

// motet.figures.feet.contacts
export const CONTACTS = {
  // Metres above the ground from which on a point has no vote on where the root goes.
  VOTING_HEIGHT: 0.07,
  // Seconds over which votes are brought together, and beyond which they do not reach.
  TOGETHER: 0.05,
  REACH: 1,
  // Metres a second by which a vote may be off, one that is faster and one that is slower.
  ALLOWED: [0.6000000000000001, 0.2],
  ADULT_HEIGHT: 1.7,
  // For the points of soles.
  SOLES: { heights: [0.02, 0.05], speeds: [0.3, 0.9], calm: 0.015 },
} as const;

// motet.figures.feet.hold.HoldSettings
export const holdSettings = {
  contact: { heights: [0.02, 0.05], speeds: [0.3, 0.9], calm: 0.015 },
  lifted: 0.1,
  blend: 0.2,
  farthest: 0.15,
  soft: 0.05,
  tremble: 0.015,
  anchor: null,
} as const;

// motet.figures.feet.treadmill.TreadmillSettings
export const treadmillSettings = {
  room: 0.5,
  share: 0.25,
  speed: 0.3,
  stride: 0.15,
  hips: 0.3,
  span: 1,
  calm: 0.015,
  fps: 30,
} as const;

// motet.figures.humanoid.alignment
export const ALIGNMENT = {
  // The weight of a limb's shortest turn beside its hinge, which counts by the sine of its bend.
  HINGE: 0.05,
} as const;

// motet.figures.humanoid.measure
export const MEASURE = {
  // Units that skeletons are written in, with their length in metres.
  LENGTH_UNITS: { metres: 1, decimetres: 0.1, "CMU's unit": 0.05644444444444444, inches: 0.0254, centimetres: 0.01, millimetres: 0.001 },
} as const;

// motet.figures.humanoid.retarget
export const RETARGET = {
  // Degrees by which the bones of a finger of a hand at rest bend, each against the one before.
  FINGER_BENDS: [15, 25, 15],
  // What the names of a finger's joints hold, and how far it is bent in a relaxed hand, times a finger's bend.
  FINGER_SHARES: { thumb: 0.5, index: 0.8, mid: 1, ring: 1.15, "pinky|little": 1.3 },
} as const;

// motet.figures.two_bones
export const TWO_BONES = {
  // The cosine of the largest bend of a knee, 162 degrees: targets beyond it are not reached.
  SHORTEST: -0.95,
  // The largest lengthening of a leg, as a share of the length left until it is straight.
  EASED_SHARE: 0.5,
  // Shares of the length of a straight leg: 1 cm, how much too long it stays when it has to bend; and 5 mm short of straight, or a knee bent by 12 degrees, where that is e times less.
  GIVES: [0.012, 0.006],
} as const;

// motet.formats.gltf
export const GLTF = {
  // The animated properties of a node, and how many numbers each has; mesh weights are left out.
  PATHS: { rotation: 4, translation: 3, scale: 3 },
  // Skins of a file, and joints of its skeleton: a figure has a skin for each of its meshes, and a detailed facial rig has a thousand joints.
  MAX_SKINS: 500,
  MAX_JOINTS: 3000,
} as const;

// motet.formats.gltf_data
export const GLTF_DATA = {
  // Nodes of a file: a figure has a few hundred.
  MAX_NODES: 20000,
} as const;

// motet.formats.text
export const TEXT = {
  // The lowest and the highest frame rate of a file: the highest is ten times what cameras take.
  FRAME_RATES: [0.001, 100000],
} as const;

// motet.generate.codec
export const CODEC = {
  // Metres that count as much as a radian where moves are compared.
  REACH: 0.5,
  // Of the decoder's channels the first: the root's forward, left and turn, seen from where the moves have led.
  PATH: 3,
} as const;

// motet.generate.codes
export const CODES = {
  // Steps that a writer looks back at most, those of the windows that writers are trained on: a stream may last for ever.
  WINDOW: 64,
} as const;

// motet.generate.codes.CodesSettings
export const codesSettings = {
  hypotheses: { default: 1, low: 1, high: 100, whole: true },
  temperature: { default: 1, low: 0.01, high: 100, whole: false },
  first_temperature: { default: 1, low: 0.01, high: 100, whole: false },
  top_p: { default: 1, low: 0.01, high: 1, whole: false },
  guidance: { default: 1, low: 0, high: 10, whole: false },
  memory: { default: 0, low: 0, high: 1, whole: false },
  certainty: { default: 1, low: 0.01, high: 100, whole: false },
  seconds: { default: 0, low: 0, high: 600, whole: false },
  max_seconds: { default: 30, low: 0, high: 600, whole: false },
} as const;

// motet.generate.continue_codes.ContinuationSettings
export const continuationSettings = {
  context: { default: 4, low: 0.5, high: 10, whole: false },
  context_steps: { default: 12, low: 1, high: 100, whole: true },
  context_fading: { default: 0.85, low: 0, high: 1, whole: false },
  actions: { default: 4, low: 1, high: 100, whole: true },
  action_scale: { default: 0.3, low: 0.001, high: 100, whole: false },
  rows: { default: 12, low: 2, high: 100, whole: true },
  moment: { default: 0.8, low: 0.1, high: 10, whole: false },
  speed_cost: { default: 1, low: 0, high: 100, whole: false },
  speed_floor: { default: 0.25, low: 0.001, high: 10, whole: false },
  turn_scale: { default: 3.490658503988659, low: 0.01, high: 100, whole: false },
  straight: { default: 0.5235987755982988, low: 0, high: 3.141592653589793, whole: false },
  going: { default: 0.5, low: 0, high: 10, whole: false },
  pace_seen: { default: 2, low: 0.1, high: 10, whole: false },
  pace_recent: { default: 2.2, low: 0.1, high: 10, whole: false },
  tempo: { default: 1.15, low: 1, high: 2, whole: false },
  tempo_reach: { default: 1.5, low: 0.1, high: 10, whole: false },
  half_life: { default: 0.1, low: 0.01, high: 1, whole: false },
  ground_seen: { default: 1, low: 0.1, high: 10, whole: false },
  ground_reach: { default: 0.7, low: 0.1, high: 10, whole: false },
  ground_limit: { default: 0.1, low: 0, high: 1, whole: false },
  anchor: { default: 1, low: 0.1, high: 10, whole: false },
} as const;

// motet.generate.memory
export const MEMORY = {
  // Weights of the last step and those before it.
  PAST: [1, 0.5, 0.25],
  // Places are drawn by exp(-distance / NEAR).
  NEAR: 0.5,
  // Added to a distance for each squared step of difference in age, and the most that is added.
  LATER: 0.015625,
  LATEST: 2,
  // The share of a motion's movement in which an action is taken up that follows another.
  EARLY: 0.3,
  // The share of the most that a number of steps can show from which on a start is as good.
  GOOD: 0.95,
  // The share of a motion's movement that may be left out from one step to the next: its act may not.
  LEAP: 0.3,
  // What a step without movement counts beside the squared differences of codes' numbers.
  REST: 0.125,
  // What the codes of a step count beside the squared differences of their numbers, where an act is looked for.
  POSE: 1,
  // The shares of a motion's act that show it where time is short, and where it is not.
  ALL: 0.95,
  // Steps, 6 s at 30 frames a second, of the shortest act: a recording that is not longer counts as one.
  WHOLE: 45,
  // The squared distance of two places up to which the one shows what the other shows; no codes are just that far apart, so that no rounding decides.
  ALIKE: 8.03,
  // Steps that an act may be longer to begin, or end, as its recording does.
  UNLIKE: 30,
  // The age of what is not shown.
  FAR: 1048576,
} as const;

// motet.generate.model
export const GENERATE_CODES = {
  // The sentence of a figure that is to stand at the start or end of a story, and for how long it stands.
  STANDING: "a person stands still",
  STANDING_SECONDS: 0.8,
  // Log-probability of an action that is not drawn.
  NEVER: -1000000000,
} as const;

// motet.generate.model.FamiliaritySettings
export const familiaritySettings = {
  confident: { default: 0.5, low: 0, high: 1, whole: false },
  doubt: { default: 0.25, low: 0, high: 10, whole: false },
} as const;

// motet.models.control
export const BASE = {
  LARGEST_CROWD: 100000,
} as const;

// motet.models.describe
export const DESCRIBE = {
  // The probability below which none is told.
  LEAST: 1e-06,
} as const;

// motet.models.describe.ConfidenceSettings
export const confidenceSettings = {
  log_probability: { default: -5.5, low: -1000, high: 0, whole: false },
} as const;

// motet.models.language
export const LANGUAGE = {
  MAX_SECONDS: 30,
} as const;

// motet.models.nearest_neighbour
export const KNOWN = {
  // What is said of a motion that is like none of those that are known, or too short to tell.
  NOTHING: "no human motion that it knows",
  // Where a sentence says that somebody goes; 0 if it does not say.
  LEFT: 1,
  RIGHT: -1,
  STRAIGHT: 2,
} as const;

// motet.models.nearest_neighbour.AnswerSettings
export const answerSettings = {
  near: { default: 40, low: 1, high: 1000, whole: true },
  temperature: { default: 0.07, low: 0.001, high: 10, whole: false },
  turned: { default: 45, low: 0, high: 360, whole: false },
  straight: { default: 25, low: 0, high: 360, whole: false },
  backwards: { default: 0.2, low: 0, high: 100, whole: false },
  window: { default: 1, low: 0.1, high: 30, whole: false },
  hop: { default: 0.2, low: 0.1, high: 30, whole: false },
  change: { default: 4.5, low: 0, high: 1000, whole: false },
  shortest: { default: 0.5, low: 0, high: 30, whole: false },
  sure: { default: 0.8, low: 0, high: 1, whole: false },
  outside: { default: 0, low: -1, high: 1, whole: false },
  bias: { default: 0, low: -1000, high: 1000, whole: false },
  share: { default: 1, low: -1000, high: 1000, whole: false },
} as const;

// motet.motion.rotations
export const ROTATIONS = {
  // Gimbal lock: below this cosine of the middle Euler angle the other two turn about the same axis.
  LOCKED: 1e-09,
} as const;

// motet.motion.skeleton
export const SKELETON = {
  END_SUFFIX: "_end",
} as const;

// motet.predict.between.BetweenSettings
export const betweenSettings = {
  context: { default: null, low: 1, high: 1000, whole: true },
  least: { default: null, low: 1, high: 1000, whole: true },
  longest: { default: null, low: 1, high: 1000, whole: true },
} as const;

// motet.predict.free_run.FreeRunSettings
export const freeRunSettings = {
  horizon: { default: null, low: 1, high: 10000, whole: true },
} as const;

// motet.predict.model
export const PREDICT = {
  MAX_FRAMES: 100000,
} as const;

// motet.representation.placed
export const PLACED = {
  // Channels of the root's place, before all axes.
  ROOT_PLACE: 3,
} as const;

// motet.search.model.IndexSettings
export const indexSettings = {
  window: { default: 10, low: 0.5, high: 30, whole: false },
  like_text: { default: 0.45, low: -1, high: 1, whole: false },
  like_motion: { default: 0.87, low: -1, high: 1, whole: false },
} as const;

// motet.search.nearest.NearestSettings
export const nearestSettings = {
  count: { default: 5, low: 1, high: 1000, whole: true },
} as const;

// motet.steering.action_layer
export const ACTING = {
  // Radians that a metre of the hips' height counts as.
  METRE: 10,
  // Times as long that what is lost fades at most: who is to kneel at once is down in half a second.
  LONGER: 1.75,
  // Radians, metres and metres a second of which nothing is seen: what is added is dropped then.
  FADED: 0.0001,
} as const;

// motet.steering.acts
export const ACTS = {
  // Frames of an act.
  SHORTEST: 3,
  // The height of the hips of a figure that stands straight.
  STANDS: 0.98,
  // Metres between the highest and the lowest that hips are, or would be standing, metres above the ground of a ball of a foot, and radians of a turn, beyond which an act is one of the legs.
  BENT: 0.25,
  RAISED: 0.3,
  TURNED: 2.6179938779914944,
  // Seconds of an act of which the rest at both ends is left out: less is a pose that is held.
  MOVES: 1,
  // Numbers of a frame: quaternions (x, y, z, w) of the bones, the hips' in the frame of the facing; x and z of the root in metres, its facing in radians, and the height of the hips in metres.
  WIDTH: 92,
  LARGEST: 10000,
} as const;

// motet.steering.acts.ActSettings
export const actSettings = {
  blend: { default: 0.12, low: 0.01, high: 10, whole: false },
  far: { default: 0.7, low: 0.01, high: 3.15, whole: false },
  entry: { default: 0.5, low: 0, high: 10, whole: false },
  rest: { default: 0.25, low: 0, high: 100, whole: false },
} as const;

// motet.steering.arrival
export const ARRIVING = {
  // How far ahead on its path a figure aims: metres, and more for each m/s.
  AHEAD: 0.3,
  SOONER: 0.25,
  // m/s^2 at which a figure slows down to the end.
  BRAKES: 1.5,
  // Metres within which a figure has arrived; and within which it steps to the end without turning there first.
  NEAR: 0.08,
  SIDESTEP: 0.7,
  // Metres from the end within which a figure that stands stays there, else it goes again; the most m/s at which what is left is made up for, standing and for each m/s of walking; and in how many seconds.
  GLIDES_FROM: 0.16,
  GLIDES: [0.05, 0.15],
  SETTLES: 0.25,
  // How far off a figure faces that has arrived, at most.
  FACES: 0.13962634015954636,
  // m/s below which a figure stands.
  STANDS: 0.1,
} as const;

// motet.steering.avoidance
export const APART = {
  // Seconds within which figures look ahead, and metres beyond which they see nobody.
  SOON: 2,
  SIGHT: 5,
  // m/s of the change for figures that are in one place.
  STRENGTH: 6,
} as const;

// motet.steering.events
export const EVENTS = {
  // A foot comes down where its contact rises above the first, once it has been below the second.
  DOWN: 0.5,
  UP: 0.2,
  // Ticks without a foot on the ground after which a figure has taken off.
  FLIES: 2,
} as const;

// motet.steering.foot_lock
export const LOCK = {
  // Half-life (s) in which a foot is lifted and let down: at once, the knee of a straight leg would pop forward.
  LIFTS: 0.035,
} as const;

// motet.steering.foot_lock.FootLockSettings
export const footLockSettings = {
  fade: { default: 0.1, low: 0.001, high: 10, whole: false },
  farthest: { default: 0.2, low: 0, high: 1, whole: false },
  swings: { default: 1, low: 0.01, high: 100, whole: false },
  stands: { default: 0.5, low: 0, high: 1, whole: false },
  bears: { default: 0.02, low: 0, high: 1, whole: false },
  steps: { default: 0.08, low: 0, high: 1, whole: false },
} as const;

// motet.steering.idle
export const STANDING = {
  // Seconds of a breath.
  PERIOD: 4,
  // Radians of a breath by which figures differ that are a metre apart, along x and z.
  WAVE: [2, 3],
  // Radians by which a breath turns the spine to either side.
  DEPTH: 0.021,
  TRUNK: [1, 2, 3],
  // By how many times its depth a breath turns bones about the x axis of the hips: those of the trunk, and what the last of them carries.
  TURNS: { 1: 1, 2: 0, 3: -2, 4: 1, 10: 1, 18: 1 },
  // Half-life in seconds in which a figure that has come to stand comes to rest and to breathe, or ceases to breathe.
  SETTLES: 0.3,
  // A figure stands that is told to, goes slower than this in m/s, with contacts of both feet above that.
  SLOW: 0.1,
  STANDS: 0.5,
  // Share below which nothing is seen of a breath.
  LEAST: 0.001,
} as const;

// motet.steering.look_layer
export const LOOKING = {
  // Bones that turn -> the share of the turn that each and those below it make together.
  SHARES: { chest: 0.1, upperChest: 0.25, neck: 0.55, head: 1 },
  // Between the eyes, from the head's joint, metres.
  EYES: [0, 0.07, 0.08],
  // The largest angles of the gaze, to a side and up or down.
  MOST: [1.4835298641951802, 0.8726646259971648],
  // Beyond this angle a figure goes on looking over the shoulder over which it looks.
  BEHIND: 2.6179938779914944,
  // Metres: nothing nearer to the eyes is looked at; and what is less aside than this is hardly turned to.
  NEAR: 0.2,
  UNDER: 0.3,
  // Radians below which nothing is turned.
  LEAST: 0.0001,
  // Radians that the gaze follows in a tick at once; and the half-life, in seconds, in which it catches up with more: 300 degrees a second at the most, in a turn by 100.
  LEAP: 0.17453292519943295,
  HALF_LIFE: 0.18,
} as const;

// motet.steering.matching
export const MATCHING = {
  // The slowest that a figure goes, m/s.
  LEAST_PACE: 0.1,
  // Number of features of a row's trajectory: places (left, forward) at each of the horizons, facings (sin, cos), and the speed at the second of them. The features after them are of the pose, all seen from the facing: places and velocities of the balls of both feet, three numbers each, the hips' velocity, and the places of both hands.
  TRAJECTORY: 13,
  FEATURES: 34,
  // Rows before and after a row that make up a stride, over which the hips' sway is none.
  STRIDE_ROWS: 15,
  STEPS: 256,
} as const;

// motet.steering.model
export const STEER = {
  // From so many characters on the searches of a session are spread over the ticks.
  SPREAD_FROM: 32,
  FEATURE_STEPS: 16,
} as const;

// motet.steering.path_following
export const LEADING = {
  // m/s or radians by which a target changes in a tick, before rows are searched for it at once.
  SUDDEN: 0.2,
  // m/s: who would go around others more slowly than this stands and lets them pass.
  WAITS: 0.2,
} as const;

// motet.steering.reach_layer
export const REACHING = {
  // Metres from the wrist to the middle of the hand, which is what reaches.
  PALM: 0.09,
  // The cosine of how far an arm turns from diagonally forward, to its own side.
  WIDEST: -0.25881904510252085,
  // Shares of the arm's length: what is between the first two away from the shoulder is reached exactly; and by how much more an arm stretches for anything farther.
  NEAREST: 0.25,
  STRAIGHT: 0.95,
  STRETCHED: 0.04,
  // The weight below which an arm is as it is played.
  LEAST: 0.001,
  // Metres from a point at which a hand has reached it.
  REACHED: 0.02,
  // Metres that a point may move in a tick and be followed at once; and the half-life, in seconds, in which a hand gets to a new point, and back.
  LEAP: 0.1,
  HALF_LIFE: 0.12,
} as const;

// motet.steering.settings.SteeringSettings
export const steeringSettings = {
  velocity: { default: 0.22, low: 0.01, high: 10, whole: false },
  facing: { default: 0.18, low: 0.01, high: 10, whole: false },
  horizon: { default: 1, low: 0.1, high: 10, whole: false },
  half_speed: { default: 0.7, low: 0.01, high: 100, whole: false },
  search_every: { default: 6, low: 1, high: 60, whole: true },
  lag: { default: 50, low: 0, high: 1000000, whole: false },
  lasting: { default: 20, low: 0, high: 10000, whole: true },
  jump_back: { default: 20, low: 0, high: 10000, whole: true },
  jump_ahead: { default: 5, low: 0, high: 10000, whole: true },
  continuing: { default: 2, low: 0, high: 1000000, whole: false },
  prepares: { default: 9, low: 0, high: 10000, whole: true },
  row_step: { default: 2, low: 1, high: 100, whole: true },
  stands: { default: 0.1, low: 0, high: 1, whole: false },
  blend: { default: 0.13, low: 0.01, high: 10, whole: false },
  slowest: { default: 0.8, low: 0.1, high: 1, whole: false },
  fastest: { default: 1.15, low: 1, high: 10, whole: false },
  shortest: { default: 0.8, low: 0.1, high: 1, whole: false },
  longest: { default: 1.25, low: 1, high: 10, whole: false },
  idle: { default: 0.4, low: 0.01, high: 100, whole: false },
  creep: { default: 0.67, low: 0.01, high: 100, whole: false },
  creep_slowest: { default: 0.5, low: 0.1, high: 1, whole: false },
  turn: { default: 0.15, low: 0.01, high: 10, whole: false },
  turn_still: { default: 0.1, low: 0, high: 100, whole: false },
  turn_moving: { default: 1, low: 0, high: 100, whole: false },
  turn_speed: { default: 1.5, low: 0, high: 100, whole: false },
  turn_turning: { default: 0.5, low: 0, high: 100, whole: false },
  warp: { default: 1, low: 0, high: 3.15, whole: false },
  veer: { default: 0.35, low: 0, high: 3.15, whole: false },
  veer_within: { default: 0.4, low: 0, high: 100, whole: false },
  aside: { default: 1.0471975511965976, low: 0, high: 3.15, whole: false },
  back: { default: 2.0943951023931953, low: 0, high: 3.15, whole: false },
  ahead: { default: 0.5235987755982988, low: 0, high: 3.15, whole: false },
} as const;

// motet.steering.targets
export const GUIDED = {
  LARGEST_COMMAND: 1000000,
  // Points of a path.
  LONGEST_PATH: 10000,
} as const;

// motet.steering.warping
export const WARPING = {
  // Radians below which nothing is turned.
  LEAST: 0.0001,
} as const;

// motet.text.clauses
export const COMPOSITION = {
  // Words that say little about what is done.
  FUNCTION_WORDS: ["a", "after", "afterwards", "along", "am", "an", "and", "are", "as", "at", "be", "before", "by", "finally", "first", "for", "from", "he", "her", "him", "his", "i", "in", "into", "is", "it", "its", "man", "my", "next", "of", "on", "or", "person", "she", "somebody", "someone", "that", "the", "their", "them", "then", "they", "this", "to", "up", "while", "who", "with", "woman", "you", "your"],
} as const;

// motet.text.vocabulary
export const VOCABULARY = {
  MAX_WORDS: 40,
  MAX_LETTERS: 2000,
} as const;
