import { TWO_BONES } from "../generated.js";
import {
  cross,
  dot,
  minus,
  ofVector,
  plus,
  product,
  type Quaternion,
  rotated,
  size,
  swing,
  times,
  unit,
  type Vector,
} from "../motion/rotations.js";

/** A thigh and a shin in one frame: hip, knee and ankle, and the axis about which the shin turns back when the knee bends; or an upper
 *  arm and a forearm: shoulder, elbow and hand. */
export class TwoBones {
  private readonly upper: number;
  private readonly lower: number;
  private readonly axis: Vector;
  /** The part of the shin in the plane of the bend. */
  private readonly inPlane: number;
  readonly longest: number;

  constructor(
    readonly hip: Vector,
    readonly knee: Vector,
    readonly ankle: Vector,
    hinge: Vector,
  ) {
    const along = minus(knee, hip);
    const down = minus(ankle, knee);
    this.upper = size(along);
    this.lower = size(down);
    this.axis = unit(minus(hinge, times(along, dot(hinge, along) / dot(along, along))));
    this.inPlane = Math.sqrt(Math.max(1 - dot(unit(down), this.axis) ** 2, 1e-12));
    this.longest = Math.sqrt(this.upper ** 2 + this.lower ** 2 + 2 * this.upper * this.lower * this.inPlane);
  }

  /** The place near a target, on the line to the hip, that the ankle reaches without a snap of the knee. */
  eased(target: Vector): Vector {
    const away = minus(target, this.hip);
    const now = size(minus(this.ankle, this.hip));
    const wanted = size(away);
    const left = Math.max(this.longest - now, 1e-9);
    const longer =
      -TWO_BONES.EASED_SHARE * left * Math.expm1(-Math.max(wanted - now, 0) / (TWO_BONES.EASED_SHARE * left));
    const less = Math.max(now - wanted, 0);
    const give = TWO_BONES.GIVES[0] * this.longest;
    const fade = TWO_BONES.GIVES[1] * this.longest;
    const shorter = less ** 2 / Math.max(less + give * Math.exp(-left / fade), 1e-12);
    return plus(this.hip, times(away, (now + longer - shorter) / Math.max(wanted, 1e-12)));
  }

  /** Turns in the world of thigh and shin that bring the ankle to a target, or as near as possible. */
  turns(target: Vector): { thigh: Quaternion; shin: Quaternion } {
    const along = minus(this.knee, this.hip);
    const down = minus(this.ankle, this.knee);
    const aim = minus(target, this.hip);
    const cosine =
      (dot(aim, aim) - this.upper ** 2 - this.lower ** 2) / (2 * this.upper * this.lower * this.inPlane);
    // the present bend; negative if forward
    const bent = Math.atan2(dot(cross(along, down), this.axis), dot(along, down));
    // a knee that is bent more than knees can be is bent no less for it, and keeps its side
    const least = Math.min(Math.cos(bent), TWO_BONES.SHORTEST);
    const angle = Math.acos(Math.max(least, Math.min(1, cosine)));
    const isForward = bent < 0 && Math.cos(bent) < TWO_BONES.FORWARD;
    const bend = ofVector(times(this.axis, (isForward ? -angle : angle) - bent));
    const thigh = swing(plus(along, rotated(bend, down)), aim);
    return { thigh, shin: product(thigh, bend) };
  }
}
