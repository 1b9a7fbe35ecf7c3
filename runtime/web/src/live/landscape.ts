/* What the page has beside its plane, some metres from where figures begin: a small hill, and a stair up and down. Metres. */
import { plus, times, unit, type Vector } from "../motion/rotations.js";
import type { Drawn, Mesh, Painter, Primitive } from "./stage.js";

/** The hill: where its middle is, how far it reaches, and how high it is. */
const HILL = { x: -6, z: 6.5, reach: 3.6, height: 1.2 };
/** The stair: its middle, half its width, where it begins, its steps up and down, their depth and height, and the landing on top. */
const STAIR = { x: 5.5, half: 1.2, begin: 5, steps: 5, tread: 0.29, rise: 0.17, landing: 1.6 };
/** Of the hill's mesh. */
const RINGS = 16;
const SECTORS = 40;
/** Metres from one look along a ray to the next, and to the last; and how often what lies between two looks is halved. */
const LOOK = 0.05;
const FARTHEST = 350;
const HALVINGS = 20;
/** It gets the theme's colour when it is drawn. */
const COLOUR = [1, 1, 1, 1];
const IDENTITY = Float32Array.from([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);

/** The height of the ground at a place. */
export function landscape(x: number, z: number): number {
  return Math.max(hill(x, z), stair(x, z));
}

/** x and z where a ray from an eye meets the ground first; null for the sky. */
export function metBy(eye: Vector, ray: Vector): [x: number, z: number] | null {
  const way = unit(ray);
  const at = (far: number) => plus(eye, times(way, far));
  const isUnder = (far: number) => at(far)[1] <= landscape(at(far)[0], at(far)[2]);
  // march to a place that is under the ground
  let far = LOOK;
  while (far < FARTHEST && !isUnder(far)) far += LOOK;
  if (far >= FARTHEST) return null;
  // bisect between it and the place before it
  let near = far - LOOK;
  for (let n = 0; n < HALVINGS; n++) {
    const middle = (near + far) / 2;
    if (isUnder(middle)) far = middle;
    else near = middle;
  }
  return [at(far)[0], at(far)[2]];
}

function hill(x: number, z: number): number {
  const away = Math.hypot(x - HILL.x, z - HILL.z) / HILL.reach;
  return away < 1 ? (HILL.height / 2) * (1 + Math.cos(Math.PI * away)) : 0;
}

function stair(x: number, z: number): number {
  if (Math.abs(x - STAIR.x) > STAIR.half) return 0;
  return STAIR.rise * Math.max(0, Math.min(STAIR.steps, ...stepsFromEnds(z)));
}

/** How many steps up a place is, counted from either end. */
function stepsFromEnds(z: number): [number, number] {
  const { begin, tread } = STAIR;
  return [Math.floor((z - begin) / tread) + 1, Math.floor((end() - z) / tread) + 1];
}

function end(): number {
  const { begin, steps, tread, landing } = STAIR;
  return begin + 2 * (steps - 1) * tread + landing;
}

/** What is drawn of it by a painter; height: of a body, by which all is drawn. */
export function drawnLandscape(painter: Painter, height: number): Drawn {
  const body = painter.avatar({
    primitives: [hillMesh(), stairMesh()],
    inverseBind: IDENTITY,
  } satisfies Mesh);
  const middle: Vector = [0, HILL.height, HILL.z];
  return { body, unit: 1 / height, places: [middle], matrices: IDENTITY, isGround: true };
}

/** Rings of corners around the middle, the last on the plane. */
function hillMesh(): Primitive {
  const corners: Vector[] = [];
  const indices: number[] = [];
  for (let ring = 0; ring <= RINGS; ring++) {
    const away = (HILL.reach * ring) / RINGS;
    for (let sector = 0; sector <= SECTORS; sector++) {
      const turn = (2 * Math.PI * sector) / SECTORS;
      const x = HILL.x + away * Math.sin(turn);
      const z = HILL.z + away * Math.cos(turn);
      const first = corners.push([x, hill(x, z), z]) - 1;
      const next = first + SECTORS + 1;
      if (ring < RINGS && sector < SECTORS) indices.push(first, next, first + 1, first + 1, next, next + 1);
    }
  }
  return primitive(corners, indices);
}

/** Of each step a box down to the ground, of which the top and the sides are seen. */
function stairMesh(): Primitive {
  const { x, half, begin, steps, tread, rise } = STAIR;
  const corners: Vector[] = [];
  const indices: number[] = [];
  const wall = (...quad: [Vector, Vector, Vector, Vector]) => {
    const first = corners.push(...quad) - 4;
    indices.push(first, first + 1, first + 2, first + 2, first + 1, first + 3);
  };
  const left = x + half;
  const right = x - half;
  for (let step = 0; step < steps; step++) {
    const top = rise * (step + 1);
    const near = begin + step * tread;
    const far = end() - step * tread;
    wall([right, top, near], [right, top, far], [left, top, near], [left, top, far]);
    wall([right, top - rise, near], [right, top, near], [left, top - rise, near], [left, top, near]);
    wall([left, top - rise, far], [left, top, far], [right, top - rise, far], [right, top, far]);
    wall([left, 0, near], [left, top, near], [left, 0, far], [left, top, far]);
    wall([right, 0, far], [right, top, far], [right, 0, near], [right, top, near]);
  }
  return primitive(corners, indices);
}

function primitive(corners: Vector[], indices: number[]): Primitive {
  const count = corners.length;
  return {
    positions: Float32Array.from(corners.flat()),
    normals: null,
    uvs: null,
    joints: new Uint16Array(4 * count),
    weights: Float32Array.from({ length: 4 * count }, (_, n) => (n % 4 ? 0 : 1)),
    indices: Uint32Array.from(indices),
    colour: COLOUR,
    image: null,
    cut: 0,
    twoSided: false,
  };
}
