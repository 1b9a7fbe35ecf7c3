/* What a page is given by the script that all pages share, motet/draw/stage.js: the view and what draws. */
import type { Quaternion, Vector } from "../motion/rotations.js";

/** Angles in degrees. dirty: something has changed that is to be drawn. */
export interface View {
  dirty: boolean;
  yaw: number;
  pitch: number;
  zoom: number;
}

/** From where is looked; only the stage looks into it. */
export type Camera = { readonly camera: unique symbol };

/** What is drawn of a figure: a body of the stage, where its joints are, and their rotations, or matrices instead of both. unit: heights of one unit. colour: which one it has; 0 is the usual one. */
export interface Drawn {
  body: unknown;
  unit: number;
  turned?: Quaternion[];
  places: Vector[];
  matrices?: Float32Array;
  colour?: number;
  /** It is part of the ground: larger than a figure, and casts no shadow. */
  isGround?: boolean;
}

/** A strip on the ground, in heights. fade: towards its end; arrows: little heads along it. */
export interface Strip {
  points: (readonly [x: number, z: number])[];
  colour: readonly number[];
  alpha: number;
  width?: number;
  fade?: boolean;
  arrows?: boolean;
}

/** A disc on the ground. */
export interface Spot {
  x: number;
  z: number;
  radius: number;
  colour: readonly number[];
  alpha: number;
}

/** A part of the mesh of an avatar, as glTF has it; a vertex hangs on four joints. */
export interface Primitive {
  positions: Float32Array;
  normals: Float32Array | null;
  uvs: Float32Array | null;
  joints: Uint16Array;
  weights: Float32Array;
  indices: Uint32Array;
  colour: readonly number[];
  image: ImageBitmap | null;
  cut: number;
  twoSided: boolean;
}

/** A body of people as the stage has it: numbers of its corners, in heights, one corner after the other, each on as many joints. */
export interface Body {
  primitives: [
    {
      positions: Float32Array;
      normals: Float32Array;
      joints: Uint16Array;
      weights: Float32Array;
      parts: Uint8Array;
      indices: Uint32Array;
    },
  ];
  /** Of each part, 0 to 255. */
  colours: readonly (readonly number[])[];
}

export interface Mesh {
  primitives: Primitive[];
  inverseBind: Float32Array;
}

/** Draws on one canvas. */
export interface Painter {
  body(body: unknown): Body;
  avatar(mesh: Mesh): unknown;
  drop(body: unknown): void;
  begin(still: boolean): { width: number; height: number };
  draw(
    camera: Camera,
    scene: { figures: Drawn[]; strips: Strip[]; spots: Spot[] },
    box?: { x: number; y: number; width: number; height: number },
  ): void;
}

export interface Stage {
  view: View;
  FIRST_VIEW: View;
  COLOURS: Record<"left" | "right" | "middle", readonly number[]>;
  openStage(canvas: HTMLCanvasElement): Painter | null;
  /** covered: pixels of the page at its lower end that something lies over. */
  cameraAt(
    target: Vector,
    heading: number,
    away: number,
    width: number,
    height: number,
    covered?: number,
  ): Camera;
  rayAt(camera: Camera, x: number, y: number): { eye: Vector; ray: Vector };
  listen(canvas: HTMLCanvasElement): void;
  turn(yaw: number, pitch: number): void;
  zoom(factor: number): void;
  resetView(): void;
  setTheme(dark: boolean): void;
  isDark(): boolean;
}
