/* What hands do: keys that are held, the round stick, a gamepad. */
import type { Stage } from "./stage.js";
import { DEAD } from "./stick.js";

/** Degrees a second that Q and E turn the view by, and the right stick of a gamepad aside and up. */
const LOOK = 100;
const PAD_ASIDE = 130;
const PAD_UP = 80;
const KNOB = 44;

/** Keys that go, to the right and up as it is seen. */
export const DIRECTIONS: Record<string, [right: number, up: number]> = {
  KeyW: [0, 1],
  ArrowUp: [0, 1],
  KeyS: [0, -1],
  ArrowDown: [0, -1],
  KeyA: [-1, 0],
  ArrowLeft: [-1, 0],
  KeyD: [1, 0],
  ArrowRight: [1, 0],
};

export class Hands {
  readonly keys = new Set<string>();
  /** What a gamepad's buttons do once they are pressed, by their numbers. */
  buttons: Record<number, () => void> = {};
  private stick: [x: number, y: number] = [0, 0];
  private pad: { x: number; y: number; hurries: boolean; down: readonly boolean[] } = {
    x: 0,
    y: 0,
    hurries: false,
    down: [],
  };

  constructor(
    private readonly stage: Stage,
    private readonly round: HTMLElement,
  ) {
    round.onpointerdown = (event) => {
      round.setPointerCapture(event.pointerId);
      this.push(event);
    };
    round.onpointermove = (event) => {
      if (round.hasPointerCapture(event.pointerId)) this.push(event);
    };
    round.onpointerup = round.onpointercancel = () => this.move(0, 0);
  }

  /** Right and up, as they are seen, together at most 1 long. */
  get pushed(): [x: number, y: number] {
    let x = this.stick[0] + this.pad.x;
    let y = this.stick[1] + this.pad.y;
    for (const [key, [right, up]] of Object.entries(DIRECTIONS)) {
      if (!this.keys.has(key)) continue;
      x += right;
      y += up;
    }
    const length = Math.hypot(x, y);
    return length > 1 ? [x / length, y / length] : length < DEAD ? [0, 0] : [x, y];
  }

  get hurries(): boolean {
    return this.keys.has("Shift") || this.pad.hurries;
  }

  /** Whether no key goes anywhere. */
  get byStick(): boolean {
    return !Object.keys(DIRECTIONS).some((key) => this.keys.has(key));
  }

  /** Turn the view by what is held, for so many seconds, and read the gamepad. */
  look(seconds: number): void {
    if (this.keys.has("KeyQ")) this.stage.turn(LOOK * seconds, 0);
    if (this.keys.has("KeyE")) this.stage.turn(-LOOK * seconds, 0);
    this.readPad(seconds);
  }

  private push({ clientX, clientY }: PointerEvent): void {
    const box = this.round.getBoundingClientRect();
    const radius = box.width / 2;
    const x = (clientX - box.left) / radius - 1;
    const y = 1 - (clientY - box.top) / radius;
    const length = Math.max(1, Math.hypot(x, y));
    this.move(x / length, y / length);
  }

  private move(x: number, y: number): void {
    this.stick = [x, y];
    (this.round.firstElementChild as HTMLElement).style.transform =
      `translate(${x * KNOB}px, ${-y * KNOB}px)`;
  }

  /** The left stick goes, the right one looks, a trigger hurries. */
  private readPad(seconds: number): void {
    const pad = [...(navigator.getGamepads?.() ?? [])].find((gamepad) => gamepad?.mapping === "standard");
    if (!pad) {
      this.pad = { ...this.pad, x: 0, y: 0, hurries: false };
      return;
    }
    const [x, y, ...looks] = pad.axes as [number, number, number, number];
    const [lookX, lookY] = looks.map((axis) => (Math.abs(axis) < DEAD ? 0 : axis)) as [number, number];
    const down = pad.buttons.map((button) => button.pressed);
    if (lookX || lookY) this.stage.turn(-PAD_ASIDE * seconds * lookX, PAD_UP * seconds * lookY);
    for (const [button, act] of Object.entries(this.buttons))
      if (down[Number(button)] && !this.pad.down[Number(button)]) act();
    this.pad = { x, y: -y, hurries: Boolean(down[7] || down[6] || down[0]), down };
  }
}
