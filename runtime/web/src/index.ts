export { Bundle, type Manifest } from "./bundle.js";
export { BundleError, DecodingError, TextError } from "./errors.js";
export {
  type AnyModel, DescribeModel, FillModel, type Frames, GenerateModel, type GenerateSettings, load, PredictModel, SearchModel,
} from "./models.js";
export { type Pose, posesOf } from "./poses.js";
