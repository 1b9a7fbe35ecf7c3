export { Bundle, type Manifest } from "./bundle.js";
export { BundleError, ControlError, DecodingError, TextError } from "./errors.js";
export type { Doing } from "./acting.js";
export { type Act, actOf } from "./acts.js";
export { ControlModel, type StartSettings } from "./control.js";
export {
  ControlSession,
  type ControlSnapshot,
  type SteeredPose,
  type Told,
  type Way,
} from "./controlSession.js";
export { DescribeModel, type Description, type DescribeSettings } from "./describe.js";
export type { FigureEvent } from "./events.js";
export { FillModel } from "./fill.js";
export {
  type Generated,
  GenerateModel,
  type GenerateSettings,
  type Passage,
  type Shown,
  type Story,
  type StorySettings,
  type Understood,
} from "./generate.js";
export type { Frames } from "./model.js";
export { type AnyModel, load, release } from "./models.js";
export { PredictModel } from "./predict.js";
export { type Hit, SearchModel } from "./search.js";
export { framesOf, type Pose, poser, posesOf } from "./poses.js";
export { readBVH, toBVH } from "./bvh.js";
export { FormatError, MotionError } from "./errors.js";
export { framesFor, motionOf, plantFeet } from "./frames.js";
export { toVRMA } from "./glbWrite.js";
export { holdFeet } from "./hold.js";
export { HUMANOID, isHumanoid } from "./humanoid.js";
export { atRest, type Motion, resampled, type World, worldOf } from "./motion.js";
export {
  type Figure,
  figureOf,
  fromHumanoid,
  type Humanoid,
  type Like,
  type NamedJoints,
  toHumanoid,
} from "./retarget.js";
export { type Joint, Skeleton } from "./skeleton.js";
export { type Avatar, type Clip, toThree, type Track } from "./three.js";
export { isInPlace, withTravel } from "./treadmill.js";
export { clipsOf, readGLB } from "./gltfMotion.js";
