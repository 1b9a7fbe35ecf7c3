/* The last seconds of the steered figure as a file. */
import { type Surface, toGLB, toVRMA } from "../formats/glb.js";
import { copyPose, newPose, type Played } from "../steering/step.js";
import { motionOf, shownOf } from "./figure.js";
import { toGIF } from "./gif.js";
import type { Scene } from "./scene.js";

/** Seconds that are kept, pixels of a GIF's sides, and ticks between two of its pictures. */
const KEPT = 8;
const SIZE = 320;
const EVERY = 3;

/** Keeps what a figure did last. */
export class Recorder {
  private poses: Played[] = [];

  constructor(
    private readonly fps: number,
    private readonly scene: Scene,
    private readonly canvas: HTMLCanvasElement,
  ) {}

  keep(pose: Played): void {
    const copy = newPose();
    copyPose(copy, pose);
    this.poses.push(copy);
    if (this.poses.length > KEPT * this.fps) this.poses.shift();
  }

  get seconds(): number {
    return this.poses.length / this.fps;
  }

  /** The bytes of a file of that kind. */
  file(kind: string): Uint8Array<ArrayBuffer> {
    if (kind === "gif") return this.gif();
    const motion = motionOf(this.poses, this.fps);
    return (
      kind === "glb" ? toGLB(motion, surfaceOf(this.scene)) : toVRMA(motion)
    ) as Uint8Array<ArrayBuffer>;
  }

  private gif(): Uint8Array<ArrayBuffer> {
    const small = new OffscreenCanvas(SIZE, SIZE);
    const ink = small.getContext("2d", { willReadFrequently: true })!;
    ink.fillStyle = getComputedStyle(document.documentElement).getPropertyValue("--back");
    const poses = this.poses.filter((_, at) => at % EVERY === 0);
    this.scene.cut();
    const shows = { trails: false, contacts: false, pause: true };
    const pictures = poses.map((pose) => {
      this.scene.draw([shownOf(pose)], EVERY / this.fps, [], undefined, shows);
      const { width, height } = this.canvas; // which are those of a sharp picture now
      const side = Math.min(width, height);
      ink.fillRect(0, 0, SIZE, SIZE);
      ink.drawImage(this.canvas, (width - side) / 2, (height - side) / 2, side, side, 0, 0, SIZE, SIZE);
      return ink.getImageData(0, 0, SIZE, SIZE).data;
    });
    return toGIF(pictures, SIZE, SIZE, (100 * EVERY) / this.fps);
  }
}

/** The usual body in metres, its colours linear, as glTF has them. */
function surfaceOf({
  body: {
    primitives: [{ positions, normals, joints, weights, parts, indices }],
    colours,
  },
  height,
}: Scene): Surface {
  const rows = (values: ArrayLike<number>, width: number) =>
    Array.from(parts, (_, at) => Array.from({ length: width }, (_, i) => values[width * at + i]!));
  const size = (row: number[]) => Math.hypot(...row);
  const carriers = weights.length / parts.length;
  const four = (row: number[]) => [...row, 0, 0, 0, 0].slice(0, 4);
  return {
    positions: rows(positions, 3).map((row) => row.map((x) => x * height)),
    normals: rows(normals, 3).map((row) => row.map((x) => x / size(row))),
    joints: rows(joints, carriers).map(four),
    weights: rows(weights, carriers).map(four),
    parts: colours.flatMap((colour, part) => {
      const triangles = indices.filter((_, at) => parts[indices[at - (at % 3)]!] === part);
      return triangles.length ? [{ colour: colour.map((x) => (x / 255) ** 2.2), triangles }] : [];
    }),
  };
}

/** Hand a file to the browser's downloads. */
export function download(content: Uint8Array<ArrayBuffer>, name: string, type: string): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([content], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
