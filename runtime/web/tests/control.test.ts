/* Commands to steered figures, and bundles of them, that are wrong are refused by name; the search is that of all rows. */
import assert from "node:assert/strict";
import test from "node:test";
import { BundleError, ControlError, ControlModel, load, type Told } from "../src/index.js";
import { Goals } from "../src/steering/goals.js";
import { steeringSettings } from "../src/generated.js";
import { settingsOf } from "../src/settings.js";
import { bundle } from "./bundles.js";

const model = (await load(await bundle("control"))) as ControlModel;

test("what cannot be followed is refused, and changes nothing", () => {
  const session = model.start({ characters: 2, strict: true });
  session.control({ gait: "walk", speed: 1.2, direction: 30 });
  const before = session.targets;
  const refused: [Told, RegExp][] = [
    [{ gait: "fly" }, /unknown gait "fly"; expected one of walk, run/],
    [{ gait: ["walk"] }, /1 gaits do not fit 2 characters/],
    [{ speed: NaN }, /speed must be finite numbers/],
    [{ speed: [1, 2, 3] }, /speed needs speed, for all or for each of 2 characters/],
    [{ speed: 50 }, /"walk" allows 0 or .* not 50/],
    [{ direction: Infinity }, /direction must be finite/],
    [{ facing: "left" as unknown as number }, /facing must be finite/],
    [{ velocity: [1] }, /a velocity needs x, z/],
    [
      {
        velocity: [
          [1, 0],
          [0, NaN],
        ],
      },
      /a velocity must be finite/,
    ],
    [{ velocity: [1, 0], speed: 1 }, /not both/],
  ];
  for (const [told, said] of refused) {
    assert.throws(
      () => session.control(told),
      (error) => error instanceof ControlError && said.test(error.message),
      JSON.stringify(told),
    );
  }
  assert.deepEqual(session.targets, before);
  for (const seconds of [-1, 1.5, NaN]) assert.throws(() => session.advance(seconds), ControlError);
  for (const characters of [0, 1.5, NaN, 1e6]) assert.throws(() => model.start({ characters }), ControlError);
  assert.throws(() => model.start({ gait: "fly" }), ControlError);
  assert.throws(() => model.start({ places: [1, 2] }), ControlError);
  assert.throws(
    () => session.restore(model.start({ characters: 2, holdFeet: false }).snapshot()),
    ControlError,
  );
});

test("ways that cannot be gone are refused, and change nothing", () => {
  const session = model.start({ characters: 2 });
  session.goTo([
    [0, 0.02],
    [3, 0],
  ]);
  const before = session.snapshot();
  const refused: [() => void, RegExp][] = [
    [() => session.lookAt([0, 1]), /points needs x, y, z, for all or for each of 2/],
    [() => session.lookAt([0, 1, NaN]), /points must be finite/],
    [() => session.lookAt([0, 1, 1], { ids: [2] }), /whole numbers from 0 to 1/],
    [
      () =>
        session.reach("left", [
          [0, 1, 1],
          [0, 1],
        ]),
      /points needs x, y, z/,
    ],
    [() => session.reach("both" as "left", [0, 1, 1]), /unknown hand "both"; expected left or right/],
    [() => session.goTo([1]), /points needs x, z, for all or for each of 2/],
    [
      () =>
        session.goTo([
          [1, 0],
          [0, NaN],
        ]),
      /points must be finite/,
    ],
    [
      () =>
        session.goTo(
          [
            [1, 0],
            [0, 1],
          ],
          { ids: [1] },
        ),
      /for each of 1/,
    ],
    [() => session.goTo([1, 0], { ids: [2] }), /whole numbers from 0 to 1/],
    [() => session.goTo([1, 0], { ids: [1, 1] }), /none twice/],
    [() => session.goTo([1, 0], { speed: 0 }), /speed must be above 0/],
    [() => session.goTo([1, 0], { facing: NaN }), /facing must be finite/],
    [() => session.goTo([1, 0], { gait: "fly" }), /unknown gait "fly"/],
    [() => session.act(["jump", "fly"]), /no act "fly"; expected a motion, or one of jump/],
    [() => session.goAlong([]), /a path needs 1 to 10000 points/],
    [() => session.goAlong([[1, 0], [2]]), /points needs x, z/],
    ...[0, 0.05, 6, NaN].map((room): [() => void, RegExp] => [
      () => session.keepApart(room),
      /keep 0.1 to 5 m apart/,
    ]),
  ];
  for (const [call, said] of refused)
    assert.throws(call, (error) => error instanceof ControlError && said.test(error.message), String(said));
  assert.deepEqual(session.snapshot(), before);
});

test("a figure arrives, says so once, and a command takes it off its path", () => {
  const session = model.start({ characters: 2 });
  session.goTo([0.5, 2], { ids: [1] });
  const happened = Array.from({ length: 480 }, () => session.advance(1 / 60)).flatMap((poses) =>
    poses.map(({ events }) => events.filter(({ kind }) => kind === "arrived").length),
  );
  assert.deepEqual(session.arrived, [false, true]);
  assert.equal(
    happened.reduce((sum, count) => sum + count),
    1,
  );
  const [x, z] = session.advance(0)[1]!.ground;
  assert.ok(Math.hypot(x - 0.5, z - 2) < 0.08, `${x}, ${z}`);
  session.control({ speed: 0 });
  assert.deepEqual(session.arrived, [false, false]);
});

test("what is out of reach is told, and what a figure no longer reaches for is not", () => {
  const session = model.start({ characters: 2 });
  session.reach("left", [
    [0.3, 1.4, 5],
    [0.2, 1.3, 0.4],
  ]);
  for (let at = 0; at < 60; at++) session.tick();
  assert.deepEqual(session.outOfReach, [
    [true, false],
    [false, false],
  ]);
  session.reach("left", null);
  session.tick();
  assert.deepEqual(session.outOfReach, [
    [false, false],
    [false, false],
  ]);
});

test("a look and a reach leave nothing once they are over, and a restored session has them", () => {
  const guided = model.start();
  const plain = model.start();
  const both = (count: number) => Array.from({ length: count }, () => [guided.tick(), plain.tick()]).at(-1)!;
  guided.lookAt([3, 1.6, 1]);
  guided.reach("right", [-0.2, 1.5, 0.4]);
  assert.notDeepEqual(...(both(30) as [unknown, unknown]));
  const before = guided.snapshot();
  const next = guided.tick();
  guided.restore(before);
  assert.deepEqual(guided.tick(), next);
  plain.tick();
  guided.lookAt(null);
  guided.reach("right", null);
  assert.deepEqual(...(both(90) as [unknown, unknown]));
});

test("a session is restored, and figures move as each would alone", () => {
  const session = model.start({ characters: 2 });
  session.control({
    gait: ["walk", "run"],
    velocity: [
      [1, 0.5],
      [-2, 1],
    ],
  });
  for (let at = 0; at < 20; at++) session.advance(1 / 60);
  const snapshot = session.snapshot();
  const next = Array.from({ length: 30 }, () => session.advance(1 / 60));
  session.restore(snapshot);
  assert.deepEqual(
    Array.from({ length: 30 }, () => session.advance(1 / 60)),
    next,
  );
  const alone = model.start({ gait: "walk" });
  alone.control({ gait: "run", velocity: [-2, 1] });
  for (let at = 0; at < 49; at++) alone.advance(1 / 60);
  assert.deepEqual(alone.advance(1 / 60), [next.at(-1)![1]]);
});

test("each of many searches in its turn, and moves as it would alone", () => {
  for (const [count, own] of [
    [40, { phases: 3 }],
    [32, { phases: 3 }],
    [31, {}], // so few search when they are told something
  ] as const) {
    const crowd = model.start({ characters: count });
    const alone = model.start(own);
    crowd.control({ gait: "run", speed: 2.5, direction: Array.from({ length: count }, (_, at) => 9 * at) });
    alone.control({ gait: "run", speed: 2.5, direction: 9 * 15 });
    for (let at = 0; at < 40; at++) assert.deepEqual(crowd.tick()[15], alone.tick()[0]);
  }
  for (const phases of [6, -1, 0.5, [0, 1, 2]]) {
    assert.throws(
      () => model.start({ characters: 2, phases }),
      /phases must be whole numbers from 0 to 5, for all or for each of 2/,
    );
  }
});

test("the search finds what a search of all rows finds", () => {
  const { goals, tables } = model.steerer.matcher;
  const width = tables.feature_mean.length;
  let state = 5;
  const random = () => (state = (state * 48271) % 2147483647) / 2147483647;
  const features = Int16Array.from(tables.features, (step) => 16 * step);
  for (const some of goals as Goals[]) {
    for (let trial = 0; trial < 20; trial++) {
      const at = some.rows[Math.floor(random() * some.rows.length)]! * width;
      const asked = Int16Array.from({ length: width }, (_, i) => features[at + i]! + 768 * (random() - 0.5));
      const costs = some.rows.map((row) => some.cost(asked, features, row * width));
      const least = Math.min(...costs);
      const found = some.nearest(asked, asked, Infinity)!;
      assert.equal(found.row, some.rows[costs.indexOf(least)]);
      assert.equal(found.cost, least);
      assert.equal(some.nearest(asked, asked, least), null);
    }
  }
});

test("settings and tables that are out of range are refused", () => {
  const steering = (values: Record<string, number>) => settingsOf("steering", steeringSettings, values);
  assert.throws(() => steering({ velocity: 0 }), /steering.velocity: must be 0.01 to 10/);
  assert.throws(() => steering({ search_every: 2.5 }), BundleError);
  assert.throws(() => steering({ wings: 2 }), /wings is unknown/);
  const { manifest, steerer } = model;
  const made = (config: object) =>
    new ControlModel({ ...manifest, config: { ...manifest.config, ...config } }, steerer.matcher.tables);
  for (const config of [{ gaits: [] }, { speeds: [[1, 2]] }, { odd: 99 }, { gaits: "walk" }])
    assert.throws(() => made(config), BundleError);
  const speeds = structuredClone(manifest.config.speeds as number[][]);
  speeds[0]![0] = 50;
  assert.throws(() => made({ speeds }), /config.speeds: must rise from the slowest/);
});

test("ground that fails, or gives no height, is refused with its place", () => {
  const session = model.start({ places: [0.5, 2, 0] });
  assert.throws(() => session.setGround(0 as never), /ground must be a function/);
  session.setGround((x, z) => (z > 1 ? NaN : x));
  assert.throws(() => session.tick(), /ground\(x, z\) gave NaN at x 0.5, z 2: a height is a number within/);
  session.setGround(() => 10001);
  assert.throws(() => session.tick(), /ground\(x, z\) gave 10001 at x 0.5, z 2: .* within 10000 m of 0/);
  const cause = new RangeError("no such tile");
  session.setGround(() => {
    throw cause;
  });
  assert.throws(
    () => session.tick(),
    (error) =>
      error instanceof ControlError &&
      error.cause === cause &&
      error.message === "ground(x, z) failed at x 0.5, z 2: RangeError: no such tile",
  );
});

test("figures come and go, and each moves as it would alone", () => {
  for (const [holdFeet, step] of [
    [true, "tick"],
    [false, "tick"],
    [true, "advance"],
  ] as const) {
    const begun = (place: number[]) => model.start({ places: place, holdFeet });
    const places = [
      [0, 0, 0],
      [1, 0.5, 30],
      [-1, 0.5, 200],
    ];
    const crowd = begun(places[0]!);
    let alone = [begun(places[0]!)];
    const moved = (session: typeof crowd) => (step === "tick" ? session.tick() : session.advance(1 / 30));
    for (let at = 0; at < 90; at++) {
      if (at === 20 || at === 40) {
        const number = alone.length;
        assert.deepEqual(crowd.add(places[number]!), [number]);
        alone.push(begun(places[number]!));
        if (step === "advance") alone[number]!.advance(0); // the crowd is shown already
        crowd.goTo([3, -number], { ids: [number] });
        alone[number]!.goTo([3, -number]);
      }
      if (at === 60) {
        crowd.remove([0]);
        alone = alone.slice(1);
      }
      if (at === 75) {
        const before = crowd.snapshot();
        crowd.add([
          [5, 5, 0],
          [6, 6, 0],
        ]);
        assert.equal(crowd.tick().length, 4);
        crowd.restore(before);
      }
      assert.deepEqual(moved(crowd), alone.flatMap(moved));
    }
    assert.equal(crowd.characters, 2);
  }
});

test("figures that cannot come or go are refused, and nothing changes", () => {
  const session = model.start({ characters: 2 });
  const before = session.snapshot();
  for (const places of [[], [0, 0], [[0, 0, NaN]], "here", null])
    assert.throws(() => session.add(places as number[]), ControlError);
  for (const who of [[], [2], [0, 0], [0, 1], 0, null])
    assert.throws(() => session.remove(who as number[]), ControlError);
  assert.throws(() => session.add([0, 0, 0], { gait: "fly" }), ControlError);
  assert.throws(() => session.add(Array<number[]>(100_000).fill([0, 0, 0])), /100000/);
  assert.deepEqual(session.snapshot(), before);
});
