/* What happens to a live figure from one tick to the next: feet come down, it leaves the ground and lands; as motet/steering/events.py says. */
import { EVENTS } from "../generated.js";

/** A foot came down, both feet left the ground ("take-off", also between the steps of a run), one came down again, the figure
 *  now moves in another gait, whose name is told, it has arrived where it was to go, or an act, whose name is told, was begun or is
 *  over: played to its end, ended or replaced. */
export interface FigureEvent {
  kind: "left foot" | "right foot" | "take-off" | "landing" | "gait" | "arrived" | "act ended" | "act begun";
  name?: string;
}

/** What a figure does, and for how many ticks it has. */
export interface Act {
  name: string;
  age: number;
}

/** Of a tick. air: ticks since a foot was down. gait: the number of the one that is played. */
export interface Happenings {
  down: readonly [left: boolean, right: boolean];
  air: number;
  gait: number;
  arrived: boolean;
  act: Act | null;
}

/** Those of the next tick; shows: whether the gait that is asked for is played, where it begins. before: null in the first tick. */
export function after(
  before: Happenings | null,
  contacts: readonly [number, number],
  gait: number,
  shows: boolean,
  arrived: boolean,
  act: Act | null,
): Happenings {
  const foot = (side: 0 | 1) =>
    before?.down[side] ? contacts[side] >= EVENTS.UP_CONTACT : contacts[side] > EVENTS.DOWN_CONTACT;
  const down: [boolean, boolean] = [foot(0), foot(1)];
  const flies = !down[0] && !down[1];
  if (!before) return { down, air: flies ? EVENTS.FLIES : 0, gait, arrived, act };
  return { down, air: flies ? before.air + 1 : 0, gait: shows ? gait : before.gait, arrived, act };
}

/** What has happened since the tick before; null: in the first tick. */
export function eventsOf(
  now: Happenings,
  earlier: Happenings | null,
  gaits: readonly string[],
): FigureEvent[] {
  const before = earlier ?? { ...now, act: null };
  const events: FigureEvent[] = [];
  if (now.down[0] && !before.down[0]) events.push({ kind: "left foot" });
  if (now.down[1] && !before.down[1]) events.push({ kind: "right foot" });
  if (now.air >= EVENTS.FLIES && before.air < EVENTS.FLIES) events.push({ kind: "take-off" });
  if (now.air === 0 && before.air >= EVENTS.FLIES) events.push({ kind: "landing" });
  if (now.gait !== before.gait) events.push({ kind: "gait", name: gaits[now.gait]! });
  if (now.arrived && !before.arrived) events.push({ kind: "arrived" });
  const begun = now.act?.age === 0 ? now.act : null;
  if (before.act && (begun || !now.act)) events.push({ kind: "act ended", name: before.act.name });
  if (begun) events.push({ kind: "act begun", name: begun.name });
  return events;
}
