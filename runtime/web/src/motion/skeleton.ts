import { MotionError } from "../errors.js";
import { extents } from "./numbers.js";
import { plus, type Quaternion, type Vector } from "./rotations.js";

/** A joint and the offset from its parent at rest; the order of Euler angles is that of its file. */
export interface Joint {
  name: string;
  /** The parent's index, which is lower, or -1 of the root alone, which is first. */
  parent: number;
  offset: Vector;
  order: string;
}

/** The node of a glTF file that a joint is: its rotation in the world at rest, and what it hangs below. */
export interface RestNode {
  name: string;
  turn: Quaternion;
  above: { turn: Quaternion; scale: number; place: Vector };
}

/** A tree of joints; y is up. The pose in which no joint turns is called the rest pose. */
export class Skeleton {
  readonly names: string[];
  private readonly places: Map<string, number>;
  /** The indices of each joint's children. */
  readonly children: number[][];
  /** Where each joint is at rest, the root at the origin. */
  readonly rest: Vector[] = [];

  /** metresPerUnit: metres of one unit of the offsets; null where the file does not say. nodes: of a glTF file's joints. */
  constructor(
    readonly joints: Joint[],
    readonly metresPerUnit: number | null = null,
    readonly nodes?: RestNode[],
  ) {
    this.names = joints.map((joint) => joint.name);
    if (!joints.length) throw new MotionError("a skeleton needs at least one joint");
    this.places = new Map(this.names.map((name, at) => [name, at]));
    if (this.places.size < joints.length) throw new MotionError("names of joints must be unique");
    this.children = joints.map(() => []);
    joints.forEach(({ name, parent, offset }, at) => {
      if (at ? !(parent >= 0 && parent < at) : parent !== -1)
        throw new MotionError(`the joint ${name} must come after its parent`);
      if (!offset.every(Number.isFinite)) throw new MotionError(`the offset of ${name} must be finite`);
      this.rest.push(at ? plus(this.rest[parent]!, offset) : [0, 0, 0]);
      if (at) this.children[parent]!.push(at);
    });
  }

  /** The largest extent of the rest pose along an axis. */
  get height(): number {
    return Math.max(...extents(this.rest));
  }

  /** The same tree with other offsets and another unit. */
  with(offset: (joint: number) => Vector, metresPerUnit: number | null): Skeleton {
    return new Skeleton(
      this.joints.map((joint, at) => ({ ...joint, offset: offset(at) })),
      metresPerUnit,
      this.nodes,
    );
  }

  index(name: string): number {
    const joint = this.places.get(name);
    if (joint === undefined) throw new MotionError(`the skeleton has no joint ${JSON.stringify(name)}`);
    return joint;
  }

  /** A joint and all that hang on it, in order. */
  under(joint: number): number[] {
    const joints = [joint];
    for (const child of joints) joints.push(...this.children[child]!);
    return joints.sort((a, b) => a - b);
  }

  /** A joint and all that it hangs on, up to the root. */
  above(joint: number): number[] {
    const joints: number[] = [];
    for (let at = joint; at >= 0; at = this.joints[at]!.parent) joints.push(at);
    return joints;
  }
}

/** A name, with a number behind it if it is taken; the result is then taken, too. */
export function unique(name: string, taken: Set<string>): string {
  let free = name;
  for (let number = 2; taken.has(free); number++) free = `${name}_${number}`;
  taken.add(free);
  return free;
}
