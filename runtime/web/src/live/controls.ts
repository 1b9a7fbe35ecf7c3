/* Buttons, keys, the text box, clicks and drops of the page. */
import { DIRECTIONS } from "./hands.js";
import { dropped } from "./drop.js";
import type { Page } from "./page.js";
import { download } from "./record.js";

const element = <T extends HTMLElement = HTMLElement>(id: string) => document.getElementById(id) as T;
const TOGGLES = ["hurry", "strafe", "trails", "contacts", "follows", "pause"] as const;
const CROWDS = [0, 1, 2, 3, 4, 7, 11, 19, 29, 49];
/** Pixels and milliseconds within which a press is a click and no drag. */
const STILL = 6;
const SHORT = 400;

/** What can be typed beside the names of acts. */
const ORDERS = [
  ...["walk", "run", "skip", "zombie", "stop", "come here", "turn left", "turn right", "turn around"],
  ...["walk slowly", "walk backwards", "walk in a circle", "step left", "step right", "faster", "slower"],
];

/** What a file is handed over as. */
const KINDS: Record<string, string> = {
  glb: "model/gltf-binary",
  vrma: "model/gltf-binary",
  gif: "image/gif",
};

export function addControls(page: Page, most: number): void {
  addGaits(page);
  for (const name of TOGGLES) element(name).onclick = () => toggle(page, name);
  element("reset").onclick = page.stage.resetView;
  element("theme").onclick = () => page.stage.setTheme(!page.stage.isDark());
  addCrowd(page, most);
  const pace = element<HTMLInputElement>("pace");
  pace.oninput = () => {
    page.state.pace = Number(pace.value);
  };
  page.stage.listen(element<HTMLCanvasElement>("canvas"));
  addClicks(page, element("canvas"));
  addText(page);
  addKeys(page);
  addFiles(page);
  for (const kind of Object.keys(KINDS)) element(kind).onclick = () => save(page, kind);
  page.hands.buttons = {
    4: () => setGait(page, nextGait(page, -1)),
    5: () => setGait(page, nextGait(page, 1)),
    9: () => toggle(page, "pause"),
  };
  element("facts").textContent =
    `${page.net.gaits.length} gaits · ${page.net.rows} recorded poses · ${page.net.fps} ticks a second`;
}

/** Say something where it is seen, and read out by screen readers. */
function reply(text: string): void {
  element("reply").textContent = text;
}

function toggle(page: Page, name: (typeof TOGGLES)[number]): void {
  page.state[name] = !page.state[name];
  element(name).setAttribute("aria-pressed", `${page.state[name]}`);
}

/** Move in a gait from now on; one that goes nowhere, a jump, is done once. */
function setGait(page: Page, gait: number): void {
  if (!goesOn(page, gait)) return page.once(page.net.gaits[gait]!);
  page.state.gait = gait;
  [...element("gaits").children].forEach(
    (button, n) => goesOn(page, n) && button.setAttribute("aria-pressed", `${n === gait}`),
  );
}

function goesOn({ net }: Page, gait: number): boolean {
  return net.speeds[net.gaits[gait]!]![1]! > 0;
}

/** The gait before or after that of the first figure, of those that go on. */
function nextGait(page: Page, by: -1 | 1): number {
  const all = [...page.net.gaits.keys()].filter((gait) => goesOn(page, gait));
  return all.at((all.indexOf(page.state.gait) + by) % all.length)!;
}

function addGaits(page: Page): void {
  page.net.gaits.forEach((gait, n) => {
    const button = document.createElement("button");
    button.textContent = gait[0]!.toUpperCase() + gait.slice(1);
    button.setAttribute("aria-keyshortcuts", `${n + 1}`);
    const key = document.createElement("kbd");
    key.textContent = `${n + 1}`;
    key.ariaHidden = "true";
    button.append(key);
    button.onclick = () => setGait(page, n);
    element("gaits").append(button);
  });
  setGait(page, 0);
}

function addCrowd(page: Page, most: number): void {
  const others = element<HTMLSelectElement>("others");
  const now = page.figures.length - 1;
  const counts = [...new Set([...CROWDS.filter((count) => count < most), now])].sort((a, b) => a - b);
  others.append(...counts.map((count) => new Option(`${count}`)));
  others.value = `${now}`;
  others.onchange = () => page.setFigures(Number(others.value) + 1);
}

/** A press without a drag sends the figure there. */
function addClicks(page: Page, canvas: HTMLElement): void {
  let pressed = { x: 0, y: 0, at: -Infinity };
  canvas.addEventListener("pointerdown", ({ clientX: x, clientY: y, timeStamp: at, isPrimary }) => {
    pressed = { x, y, at: isPrimary ? at : -Infinity };
  });
  canvas.addEventListener("pointerup", ({ clientX, clientY, timeStamp }) => {
    const box = canvas.getBoundingClientRect();
    const point = page.scene.groundAt(clientX - box.left, clientY - box.top);
    const still =
      Math.hypot(clientX - pressed.x, clientY - pressed.y) < STILL && timeStamp - pressed.at < SHORT;
    if (still && point) page.goTo(point);
  });
}

function addText(page: Page): void {
  const text = element<HTMLInputElement>("text");
  element<HTMLFormElement>("say").onsubmit = (event) => {
    event.preventDefault();
    if (text.value.trim()) reply(page.obey(text.value));
    text.select();
  };
  const styles = page.net.model.styles.slice(1).map((name) => `walk ${name}`);
  const known = [...page.repertoire.entries.keys(), ...ORDERS, ...styles];
  element("known").append(...known.map((name) => new Option(name)));
  text.onkeydown = ({ key }) => {
    if (key === "Escape") element("canvas").focus();
  };
}

function addKeys(page: Page): void {
  const { stage } = page;
  const { keys } = page.hands;
  const once: Record<string, () => void> = {
    Space: () => toggle(page, "pause"),
    KeyG: () => toggle(page, "strafe"),
    KeyV: () => toggle(page, "trails"),
    KeyC: () => toggle(page, "contacts"),
    KeyF: () => toggle(page, "follows"),
    KeyR: () => stage.resetView(),
    KeyT: () => stage.setTheme(!stage.isDark()),
    Equal: () => stage.zoom(1.1),
    NumpadAdd: () => stage.zoom(1.1),
    Minus: () => stage.zoom(1 / 1.1),
    NumpadSubtract: () => stage.zoom(1 / 1.1),
    Slash: () => element("text").focus(),
  };
  window.onkeydown = (event) => {
    if (takes(event) || event.ctrlKey || event.metaKey || event.altKey) return;
    const digit = Number(/^(?:Digit|Numpad)([1-9])$/.exec(event.code)?.[1] ?? 0);
    if (event.key === "Shift") keys.add("Shift");
    else if (event.code in DIRECTIONS || /^Key[QE]$/.test(event.code)) keys.add(event.code);
    else if (digit && digit <= page.net.gaits.length) setGait(page, digit - 1);
    else if (event.code in once && !event.repeat) once[event.code]!();
    else return;
    event.preventDefault();
  };
  window.onkeyup = (event) => {
    keys.delete(event.key === "Shift" ? "Shift" : event.code);
  };
  window.onblur = () => keys.clear();
}

/** Whether what has the focus needs the key itself. */
function takes({ target, code }: KeyboardEvent): boolean {
  const place = target as HTMLElement;
  if (place.tagName === "INPUT")
    return (place as HTMLInputElement).type === "text" || code.startsWith("Arrow");
  const presses = place.tagName === "BUTTON" || place.tagName === "SUMMARY";
  return (place.tagName === "SELECT" && !code.startsWith("Key")) || (presses && code === "Space");
}

function addFiles(page: Page): void {
  const chosen = element<HTMLInputElement>("file");
  element("open").onclick = () => chosen.click();
  chosen.onchange = () => void take(page, chosen.files);
  window.ondragover = (event) => event.preventDefault();
  window.ondrop = (event) => {
    event.preventDefault();
    void take(page, event.dataTransfer?.files ?? null);
  };
}

/** The first of some files moves the figure, or becomes it; what is wrong is said. */
async function take(page: Page, files: FileList | null): Promise<void> {
  const file = files?.[0];
  if (!file) return;
  reply(`reading ${file.name}`);
  await dropped(file, page.net.fps)
    .then((shown) => page.show(shown))
    .then(reply, (error: Error) => reply(error.message));
}

function save(page: Page, kind: string): void {
  download(page.recorder.file(kind), `motet.${kind}`, KINDS[kind]!);
  reply(`saved the last ${page.recorder.seconds.toFixed(0)} s as motet.${kind}`);
}
