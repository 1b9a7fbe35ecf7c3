/* The script of the page of `motet live`, without modules: motet/live/control.js. */
export { actOf } from "./steering/acts.js";
export { Figure, modelOf } from "./live/figure.js";
export { open } from "./live/page.js";
export { plus, rotated } from "./motion/rotations.js";
