/* Written by runtime/web/generate.py: do not edit. Units stand in the modules of Python. */
import { ranges } from "./settings.js";

// motet.bundle.bundle
export const BUNDLE = {
  MAX_MANIFEST: 4194304,
} as const;

// motet.bundle.fields
export const FIELDS = {
  LARGEST_NUMBER: 1000000000,
} as const;

// motet.bundle.graph_safety
export const GRAPH_SAFETY = {
  MAX_DEPTH: 64,
  MAX_FIELDS: 100000,
  MESSAGES: { model: { plain: [1, 2, 3, 4, 5, 6, 14], nested: { 7: "graph", 8: "opset" }, name: 0, domain: 0 }, opset: { plain: [1, 2], nested: {  }, name: 0, domain: 1 }, graph: { plain: [2, 10, 11, 12, 13, 14, 16], nested: { 1: "node", 5: "tensor", 15: "sparse" }, name: 2, domain: 0 }, node: { plain: [1, 2, 3, 4, 6, 7, 8, 9], nested: { 5: "attribute" }, name: 3, domain: 7 }, attribute: { plain: [1, 2, 3, 4, 7, 8, 9, 13, 14, 15, 20], nested: { 5: "tensor", 6: "graph", 10: "tensor", 11: "graph", 22: "sparse", 23: "sparse" }, name: 1, domain: 0 }, sparse: { plain: [3], nested: { 1: "tensor", 2: "tensor" }, name: 0, domain: 0 }, tensor: { plain: [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 16], nested: {  }, name: 8, domain: 0 } },
} as const;

// motet.bundle.manifest
export const MANIFEST = {
  FORMAT: 3,
} as const;

// motet.bundle.members
export const MEMBERS = {
  MAX_FILES: 64,
  MAX_SIZE: 268435456,
} as const;

// motet.decode.beam.ConsensusSettings
export const consensusSettings = ranges({
  max_words: { default: null, low: 1, high: 1000, whole: true },
  beams: { default: 5, low: 1, high: 100, whole: true },
  draws: { default: 100, low: 1, high: 1000, whole: true },
  temperature: { default: 1, low: 0.01, high: 100, whole: false },
});

// motet.figures.feet.contacts
export const CONTACTS = {
  ADULT_HEIGHT: 1.7,
  ALLOWED: [0.6000000000000001, 0.2],
  GRAVITY: 9.81,
  REWEIGHTINGS: 10,
  RISE_SPAN: 0.05,
  SOLES: { heights: [0.02, 0.05], speeds: [0.3, 0.9], calm: 0.015 },
  VOTE_DECAY_SECONDS: 0.05,
  VOTING_HEIGHT: 0.07,
  VOTING_SECONDS: 1,
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
  least: 0.5,
  calm: 0.015,
  fps: 30,
} as const;

// motet.figures.humanoid.alignment
export const ALIGNMENT = {
  HINGE: 0.05,
} as const;

// motet.figures.humanoid.measure
export const MEASURE = {
  ADULT_LEG: 0.82,
  ALONG: 0.82,
  BENT: 0.3,
  LENGTH_UNITS: { metres: 1, decimetres: 0.1, "CMU's unit": 0.05644444444444444, inches: 0.0254, centimetres: 0.01, millimetres: 0.001 },
  LIKELY_LEGS: [0.55, 1.1],
  POSSIBLE_LEGS: [0.2, 1.6],
} as const;

// motet.figures.humanoid.retarget
export const RETARGET = {
  FINGER_BENDS: [15, 25, 15],
  FINGER_SHARES: { thumb: 0.5, index: 0.8, mid: 1, ring: 1.15, "pinky|little": 1.3 },
} as const;

// motet.figures.two_bones
export const TWO_BONES = {
  EASED_SHARE: 0.5,
  FORWARD: 0.97,
  GIVES: [0.012, 0.006],
  SHORTEST: -0.95,
} as const;

// motet.formats.gltf
export const GLTF = {
  MAX_JOINTS: 3000,
  MAX_SKINS: 500,
} as const;

// motet.formats.gltf_data
export const GLTF_DATA = {
  MAX_NODES: 20000,
  REST_TRANSFORM: { translation: [0, 0, 0], rotation: [0, 0, 0, 1], scale: [1, 1, 1] },
} as const;

// motet.formats.text
export const TEXT = {
  FRAME_RATES: [0.001, 100000],
} as const;

// motet.generate.base.FamiliaritySettings
export const familiaritySettings = ranges({
  confident: { default: 0.5, low: 0, high: 1, whole: false },
  doubt: { default: 0.25, low: 0, high: 10, whole: false },
});

// motet.generate.codec
export const CODEC = {
  PATH_CHANNELS: 3,
  RADIAN_METRES: 0.5,
} as const;

// motet.generate.codes
export const CODES = {
  WINDOW: 64,
} as const;

// motet.generate.codes.CodesSettings
export const codesSettings = ranges({
  hypotheses: { default: 1, low: 1, high: 100, whole: true },
  temperature: { default: 1, low: 0.01, high: 100, whole: false },
  first_temperature: { default: 1, low: 0.01, high: 100, whole: false },
  top_p: { default: 1, low: 0.01, high: 1, whole: false },
  guidance: { default: 1, low: 0, high: 10, whole: false },
  memory: { default: 0, low: 0, high: 1, whole: false },
  certainty: { default: 1, low: 0.01, high: 100, whole: false },
  seconds: { default: 0, low: 0, high: 600, whole: false },
  max_seconds: { default: 30, low: 0, high: 600, whole: false },
});

// motet.generate.continue_codes.ContinuationSettings
export const continuationSettings = ranges({
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
});

// motet.generate.memory
export const MEMORY = {
  FORGOTTEN_AGE: 1048576,
} as const;

// motet.generate.memory.MemorySettings
export const memorySettings = ranges({
  past_steps: { default: 3, low: 1, high: 16, whole: true },
  past_fading: { default: 0.5, low: 0, high: 1, whole: false },
  distance_scale: { default: 0.5, low: 1e-06, high: 1000000, whole: false },
  age_cost: { default: 0.015625, low: 0, high: 1000000, whole: false },
  age_cost_limit: { default: 2, low: 0, high: 1000000, whole: false },
  entry: { default: 0.3, low: 0, high: 1, whole: false },
  skip: { default: 0.3, low: 0, high: 1, whole: false },
  rest_weight: { default: 0.125, low: 1e-06, high: 1000000, whole: false },
  pose_weight: { default: 1, low: 1e-06, high: 1000000, whole: false },
  good_start: { default: 0.95, low: 0, high: 1, whole: false },
  quick_share: { default: 0.8, low: 0, high: 1, whole: false },
  act_share: { default: 0.95, low: 0, high: 1, whole: false },
  tempo: { default: 1.2, low: 1, high: 10, whole: false },
  act_steps: { default: 45, low: 1, high: 10000, whole: true },
  alike_distance: { default: 8.03, low: 1e-06, high: 1000000, whole: false },
  edge_cost: { default: 30, low: 0, high: 10000, whole: false },
});

// motet.generate.model
export const GENERATE = {
  STANDING_SECONDS: 0.8,
  STANDS: "a person stands still",
} as const;

// motet.generate.reading
export const READING = {
  FAR_LESS: -100,
  NEVER: -1000000000,
} as const;

// motet.models.control
export const CONTROL = {
  LARGEST_CROWD: 100000,
} as const;

// motet.models.describe
export const DESCRIBE = {
  LEAST_PROBABILITY: 1e-06,
} as const;

// motet.models.describe.ConfidenceSettings
export const confidenceSettings = ranges({
  log_probability: { default: -5.5, low: -1000, high: 0, whole: false },
});

// motet.models.language
export const LANGUAGE = {
  MAX_SECONDS: 30,
} as const;

// motet.models.nearest_neighbour
export const NEAREST_NEIGHBOUR = {
  GOES_LEFT: 1,
  GOES_RIGHT: -1,
  GOES_STRAIGHT: 2,
  NOTHING: "no human motion that it knows",
} as const;

// motet.models.nearest_neighbour.AnswerSettings
export const answerSettings = ranges({
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
});

// motet.motion.rotations
export const ROTATIONS = {
  LOCKED: 1e-09,
} as const;

// motet.motion.skeleton
export const SKELETON = {
  END_SUFFIX: "_end",
} as const;

// motet.predict.between.BetweenSettings
export const betweenSettings = ranges({
  context: { default: null, low: 1, high: 1000, whole: true },
  least: { default: null, low: 1, high: 1000, whole: true },
  longest: { default: null, low: 1, high: 1000, whole: true },
});

// motet.predict.free_run.FreeRunSettings
export const freeRunSettings = ranges({
  horizon: { default: null, low: 1, high: 10000, whole: true },
});

// motet.predict.model
export const PREDICT = {
  MAX_FRAMES: 100000,
} as const;

// motet.representation.placed
export const PLACED = {
  ROOT_PLACE: 3,
} as const;

// motet.representation.retargeting
export const RETARGETING = {
  FARTHEST_BONES: 45,
  SHORTEST_BONE: 1e-06,
} as const;

// motet.representation.root_sixd
export const ROOT_SIXD = {
  FACING_SPREAD: 0.13333333333333333,
} as const;

// motet.search.model.IndexSettings
export const indexSettings = ranges({
  window: { default: 10, low: 0.5, high: 30, whole: false },
  like_text: { default: 0.45, low: -1, high: 1, whole: false },
  like_motion: { default: 0.87, low: -1, high: 1, whole: false },
});

// motet.search.nearest.NearestSettings
export const nearestSettings = ranges({
  count: { default: 5, low: 1, high: 1000, whole: true },
});

// motet.steering.action_layer
export const ACTION_LAYER = {
  FADED: 0.0001,
} as const;

// motet.steering.acts
export const ACTS = {
  LARGEST_COORDINATE: 10000,
  LEAST_ACT_FRAMES: 3,
  STANDING_HIPS: 0.98,
  WIDTH: 92,
} as const;

// motet.steering.acts.ActSettings
export const actSettings = ranges({
  blend: { default: 0.12, low: 0.01, high: 10, whole: false },
  far: { default: 0.7, low: 0.01, high: 3.15, whole: false },
  height_weight: { default: 10, low: 0, high: 100, whole: false },
  longest: { default: 1.75, low: 1, high: 10, whole: false },
  entry: { default: 0.5, low: 0, high: 10, whole: false },
  rest: { default: 0.25, low: 0, high: 100, whole: false },
  moves: { default: 1, low: 0, high: 10, whole: false },
  bent: { default: 0.25, low: 0, high: 100, whole: false },
  raised: { default: 0.3, low: 0, high: 100, whole: false },
  turned: { default: 2.6179938779914944, low: 0, high: 3.15, whole: false },
});

// motet.steering.paths.ArrivalSettings
export const arrivalSettings = ranges({
  ahead: { default: 0.2, low: 0, high: 100, whole: false },
  ahead_moving: { default: 0.1, low: 0, high: 10, whole: false },
  turns_back: { default: 0.35, low: 0, high: 1, whole: false },
  brakes: { default: 6, low: 0.1, high: 100, whole: false },
  catches_up: { default: 0.3, low: 0.01, high: 100, whole: false },
  strays: { default: 0.4, low: 0, high: 100, whole: false },
  near: { default: 0.08, low: 0, high: 100, whole: false },
  sidestep: { default: 0.7, low: 0, high: 100, whole: false },
  glides_from: { default: 0.16, low: 0, high: 100, whole: false },
  glides: { default: 0.05, low: 0, high: 100, whole: false },
  glides_moving: { default: 0.15, low: 0, high: 10, whole: false },
  settles: { default: 0.25, low: 0.01, high: 100, whole: false },
  faces: { default: 0.13962634015954636, low: 0, high: 3.15, whole: false },
  stands: { default: 0.1, low: 0, high: 100, whole: false },
  sudden: { default: 0.2, low: 0, high: 100, whole: false },
});

// motet.steering.avoidance.AvoidanceSettings
export const avoidanceSettings = ranges({
  soon: { default: 2, low: 0.01, high: 100, whole: false },
  parts: { default: 0.4, low: 0.01, high: 100, whole: false },
  closes: { default: 1, low: 0, high: 100, whole: false },
  sight: { default: 5, low: 0, high: 100, whole: false },
  heeds: { default: 8, low: 0, high: 10000, whole: true },
  sweeps: { default: 8, low: 0, high: 10000, whole: true },
  yields: { default: 0.3, low: 0, high: 1, whole: false },
  dodges: { default: 0.6, low: 0, high: 100, whole: false },
  waits: { default: 0.02, low: 0, high: 100, whole: false },
  rejoins: { default: 0.1, low: 0, high: 100, whole: false },
  standing: { default: 0.7, low: 0, high: 1, whole: false },
  gives_way: { default: 0.9, low: 0, high: 3.15, whole: false },
});

// motet.steering.events
export const EVENTS = {
  DOWN_CONTACT: 0.5,
  FLIES: 2,
  UP_CONTACT: 0.2,
} as const;

// motet.steering.foot_lock.FootLockSettings
export const footLockSettings = ranges({
  fade: { default: 0.1, low: 0.001, high: 10, whole: false },
  farthest: { default: 0.2, low: 0, high: 1, whole: false },
  stretches: { default: 1.01, low: 0.1, high: 10, whole: false },
  swings: { default: 1, low: 0.01, high: 100, whole: false },
  stands: { default: 0.5, low: 0, high: 1, whole: false },
  bears: { default: 0.03, low: 0, high: 1, whole: false },
  low: { default: 0.5, low: 0, high: 1, whole: false },
  steps: { default: 0.08, low: 0, high: 1, whole: false },
  leaves: { default: 0.1, low: 0, high: 1, whole: false },
  clears: { default: 0.06, low: 0, high: 1, whole: false },
  lifts: { default: 0.035, low: 0.001, high: 10, whole: false },
});

// motet.steering.idle
export const IDLE = {
  BREATH_TURNS: { 1: 1, 2: 0, 3: -2, 4: 1, 10: 1, 18: 1 },
  LEAST_BREATH: 0.001,
  TRUNK_BONES: [1, 2, 3],
} as const;

// motet.steering.idle.IdleSettings
export const idleSettings = ranges({
  settles: { default: 0.3, low: 0.01, high: 10, whole: false },
  slow: { default: 0.1, low: 0, high: 100, whole: false },
  stands: { default: 0.5, low: 0, high: 1, whole: false },
  breath: { default: 4, low: 0.01, high: 100, whole: false },
  depth: { default: 0.021, low: 0, high: 3.15, whole: false },
  wave_x: { default: 2, low: -100, high: 100, whole: false },
  wave_z: { default: 3, low: -100, high: 100, whole: false },
});

// motet.steering.look_layer
export const LOOK_LAYER = {
  EYES_OFFSET: [0, 0.07, 0.08],
  LEAST_TURN: 0.0001,
  SHARES: { chest: 0.1, upperChest: 0.25, neck: 0.55, head: 1 },
} as const;

// motet.steering.look_layer.LookSettings
export const lookSettings = ranges({
  aside: { default: 1.4835298641951802, low: 0, high: 3.15, whole: false },
  up: { default: 0.8726646259971648, low: 0, high: 3.15, whole: false },
  behind: { default: 2.6179938779914944, low: 0, high: 3.15, whole: false },
  near: { default: 0.2, low: 0, high: 100, whole: false },
  under: { default: 0.3, low: 0, high: 100, whole: false },
  leap: { default: 0.17453292519943295, low: 0, high: 3.15, whole: false },
  half_life: { default: 0.18, low: 0.01, high: 10, whole: false },
});

// motet.steering.matching
export const MATCHING = {
  FEATURES: 34,
  LEAST_PACE: 0.1,
  STEPS: 256,
  STRIDE_ROWS: 15,
  TRAJECTORY: 13,
} as const;

// motet.steering.model
export const STEERING = {
  FEATURE_STEPS: 16,
  SPREAD_FROM: 32,
} as const;

// motet.steering.reach_layer
export const REACH_LAYER = {
  LEAST_WEIGHT: 0.001,
  PALM: 0.09,
  WRAP_COSINE: -0.7,
} as const;

// motet.steering.reach_layer.ReachSettings
export const reachSettings = ranges({
  widest: { default: 1.8325957145940461, low: 0, high: 3.15, whole: false },
  lets_go: { default: 0.4363323129985824, low: 0, high: 3.15, whole: false },
  nearest: { default: 0.25, low: 0, high: 1, whole: false },
  straight: { default: 0.95, low: 0, high: 1, whole: false },
  stretched: { default: 0.04, low: 0.001, high: 1, whole: false },
  reached: { default: 0.02, low: 0, high: 100, whole: false },
  leap: { default: 0.1, low: 0, high: 100, whole: false },
  half_life: { default: 0.12, low: 0.01, high: 10, whole: false },
});

// motet.steering.repertoire
export const REPERTOIRE = {
  MADE_ACTS: 256,
  SEAM: 9,
} as const;

// motet.steering.saying
export const SAYING = {
  GOING_SECONDS: 3,
  NEARER_DISTANCE: 2.5,
  SECONDS_OF_DEGREE: 0.008,
  TURN_SECONDS: 1.5,
} as const;

// motet.steering.settings.SteeringSettings
export const steeringSettings = ranges({
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
});

// motet.steering.spoken
export const SPOKEN = {
  CURVE: 50,
  FAST_FACTOR: 1.4,
  GOING_KINDS: ["forward", "backwards", "back", "circle", "step", "sideways"],
  JOG: 0.8,
  MOST_TIMES: 10,
  OFFERED: 3,
  SHORTEST_MENDED: 4,
  SLOW_FACTOR: 0.65,
  STEP: 0.6,
} as const;

// motet.steering.stepping
export const STEPPING = {
  FREE: -1,
} as const;

// motet.steering.stepping.StepSettings
export const stepSettings = ranges({
  swing: { default: 0.4, low: 0.05, high: 5, whole: false },
  lowest: { default: 0.045, low: 0.001, high: 1, whole: false },
  highest: { default: 0.07, low: 0.001, high: 1, whole: false },
  longest: { default: 0.4, low: 0.001, high: 1, whole: false },
  stray: { default: 0.15, low: 0.001, high: 1, whole: false },
  settles: { default: 0.03, low: 0.001, high: 1, whole: false },
  leads: { default: 0.4, low: 0, high: 5, whole: false },
  lead: { default: 0.1, low: 0.001, high: 1, whole: false },
  mean: { default: 0.2, low: 0.001, high: 10, whole: false },
  rests: { default: 0.5, low: 0, high: 1, whole: false },
});

// motet.steering.style_layer
export const STYLE_LAYER = {
  LEAST_STYLE: 0.01,
} as const;

// motet.steering.style_layer.StyleSettings
export const styleSettings = ranges({
  fades: { default: 0.18, low: 0.01, high: 10, whole: false },
  sways: { default: 0.06, low: 0.01, high: 10, whole: false },
});

// motet.steering.styles
export const STYLES = {
  ARMS: ["leftUpperArm", "leftLowerArm", "leftHand", "rightUpperArm", "rightLowerArm", "rightHand"],
  NO_STYLE: "none",
  STEPS_OF_STYLE: 1000,
  TURNED: ["hips", "spine", "chest", "upperChest", "neck", "head", "leftShoulder", "rightShoulder"],
} as const;

// motet.steering.targets
export const TARGETS = {
  LARGEST_COMMAND: 1000000,
  LONGEST_PATH: 10000,
} as const;

// motet.steering.terrain
export const TERRAIN = {
  GLANCES: 4,
  HIGHEST_GROUND: 10000,
  LEAST_SQUARED_SPEED: 0.0001,
} as const;

// motet.steering.terrain.TerrainSettings
export const terrainSettings = ranges({
  stands: { default: 0.5, low: 0, high: 1, whole: false },
  feet: { default: 0.015, low: 0.01, high: 10, whole: false },
  tilt: { default: 0.06, low: 0.01, high: 10, whole: false },
  hips: { default: 0.09, low: 0.01, high: 10, whole: false },
  steepest: { default: 40, low: 0, high: 80, whole: false },
  spread: { default: 0.04, low: 0, high: 100, whole: false },
  climbs: { default: 0.9, low: 0.01, high: 10, whole: false },
  foresees: { default: 0.24, low: 0.01, high: 100, whole: false },
  swings: { default: 1.7, low: 1, high: 5, whole: false },
  half_step: { default: 0.35, low: 0.01, high: 100, whole: false },
  straight: { default: 0.97, low: 0, high: 1, whole: false },
  uphill: { default: 0.7, low: 0, high: 10, whole: false },
  slope_span: { default: 0.6, low: 0, high: 100, whole: false },
});

// motet.steering.turn_limit
export const TURN_LIMIT = {
  LIMITED: { 1: "trunk", 2: "trunk", 3: "trunk", 4: "head", 5: "head", 10: "shoulder", 18: "shoulder", 11: "upper_arm", 19: "upper_arm", 12: "lower_arm", 20: "lower_arm", 13: "hand", 21: "hand", 6: "upper_leg", 14: "upper_leg", 7: "lower_leg", 15: "lower_leg", 8: "foot", 16: "foot", 9: "toes", 17: "toes" },
} as const;

// motet.steering.turn_limit.TurnSettings
export const turnSettings = ranges({
  trunk: { default: 540, low: 1, high: 5400, whole: false },
  head: { default: 450, low: 1, high: 5400, whole: false },
  shoulder: { default: 360, low: 1, high: 5400, whole: false },
  upper_arm: { default: 960, low: 1, high: 5400, whole: false },
  lower_arm: { default: 960, low: 1, high: 5400, whole: false },
  hand: { default: 1035, low: 1, high: 5400, whole: false },
  upper_leg: { default: 780, low: 1, high: 5400, whole: false },
  lower_leg: { default: 990, low: 1, high: 5400, whole: false },
  foot: { default: 1020, low: 1, high: 5400, whole: false },
  toes: { default: 1035, low: 1, high: 5400, whole: false },
});

// motet.steering.warping
export const WARPING = {
  LEAST_CHANGE: 0.0001,
} as const;

// motet.text.clauses
export const CLAUSES = {
  FUNCTION_WORDS: ["a", "after", "afterwards", "along", "am", "an", "and", "are", "as", "at", "athlete", "avatar", "be", "before", "boy", "by", "character", "child", "finally", "first", "for", "from", "girl", "guy", "he", "her", "him", "his", "i", "in", "into", "is", "it", "its", "kid", "lady", "man", "my", "next", "of", "on", "or", "our", "patient", "person", "player", "she", "somebody", "someone", "student", "that", "the", "their", "them", "then", "they", "this", "to", "up", "while", "who", "with", "woman", "worker", "you", "your"],
  POLITE_WORDS: ["a", "again", "an", "and", "do", "does", "finally", "first", "her", "his", "its", "just", "make", "makes", "my", "next", "now", "please", "take", "takes", "the", "their", "then", "to", "your"],
} as const;

// motet.text.vocabulary
export const VOCABULARY = {
  MAX_LETTERS: 2000,
  MAX_WORDS: 40,
} as const;
