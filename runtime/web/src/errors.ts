/** A bundle that is damaged, unsafe, of another format, or does not fit its own contract. */
export class BundleError extends Error {
  override name = "BundleError";
}

/** A sentence that a model cannot read. */
export class TextError extends Error {
  override name = "TextError";
}

/** Settings or frames that a model cannot work with. */
export class DecodingError extends Error {
  override name = "DecodingError";
}

/** A command to a steered figure that cannot be followed. */
export class ControlError extends Error {
  override name = "ControlError";
}

/** A figure that is no human's, or a motion that cannot be used. */
export class MotionError extends Error {
  override name = "MotionError";
}

/** A file that is no motion, is cut short or is damaged; it says where. */
export class FormatError extends MotionError {
  override name = "FormatError";
}
