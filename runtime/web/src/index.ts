export { Bundle, type Manifest } from "./bundle/bundle.js";
export { BundleError, ControlError, DecodingError, TextError } from "./errors.js";
export type { Doing } from "./steering/actionLayer.js";
export { type Act, actOf } from "./steering/acts.js";
export { ControlModel, type StartSettings } from "./steering/model.js";
export {
  ControlSession,
  type ControlSnapshot,
  type SteeredPose,
  type Told,
  type Way,
} from "./steering/session.js";
export { DescribeModel, type Description, type DescribeSettings } from "./models/describe.js";
export type { GroundHeight } from "./steering/terrain.js";
export type { FigureEvent } from "./steering/events.js";
export { FillModel } from "./predict/fill.js";
export {
  type Generated,
  GenerateModel,
  type GenerateSettings,
  type Passage,
  type Shown,
  type Story,
  type StorySettings,
  type Understood,
} from "./generate/model.js";
export type { Frames } from "./models/base.js";
export { type AnyModel, load, release } from "./models/load.js";
export { PredictModel } from "./predict/model.js";
export { type Hit, SearchModel } from "./search/model.js";
export { framesOf, type Pose, poser, posesOf } from "./representation/poses.js";
export { readBVH, toBVH } from "./formats/bvh.js";
export { FormatError, MotionError } from "./errors.js";
export { framesFor, motionOf, plantFeet } from "./representation/frames.js";
export { toVRMA } from "./formats/glb.js";
export { holdFeet } from "./figures/feet/hold.js";
export { HUMANOID, isHumanoid } from "./figures/humanoid/bones.js";
export { atRest, type Motion, resampled, type World, worldOf } from "./motion/motion.js";
export {
  type Figure,
  figureOf,
  fromHumanoid,
  type Humanoid,
  type Like,
  type NamedJoints,
  toHumanoid,
} from "./figures/humanoid/retarget.js";
export { type Joint, Skeleton } from "./motion/skeleton.js";
export { type Avatar, type Clip, toThree, type Track } from "./formats/three.js";
export { isInPlace, withTravel } from "./figures/feet/treadmill.js";
export { clipsOf, readGLB } from "./formats/gltf.js";
