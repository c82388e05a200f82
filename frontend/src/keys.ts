// The keyboard.

import { button, element } from "./elements";
import type { RoadMap } from "./map";
import type { Player } from "./player";
import type { Run } from "./run";
import type { Layers, State } from "./state";

interface Parts {
  run: Run;
  state: State;
  map: RoadMap;
  player: Player;
  jump: (event: number) => void;
}

const KEYS: [string, string][] = [
  ["space", "play, pause"],
  ["← →", "one step back, forward (with shift: one second)"],
  ["Home, End", "to the start, to the end"],
  [", .", "slower, faster"],
  ["N, B", "next, previous event"],
  ["[ ]", "previous, next agent"],
  ["Esc", "clear the selection"],
  ["F", "follow the selected vehicle"],
  ["+ − 0", "zoom in, zoom out, show everything"],
  ["W A S D", "move the map"],
  ["P C R V M L", "show plan, candidates, predictions, view, V2X, ids"],
  ["E", "predictions of all participants or only of conflict partners"],
  ["I", "save the map as a picture"],
  ["T", "light or dark"],
  ["Shift+A", "larger text"],
];

export function helpDialog(): HTMLDialogElement {
  const table = element("table", { class: "keys" });
  for (const [key, what] of KEYS) table.append(element("tr", {}, element("th", {}, key), element("td", {}, what)));
  const mouse = element(
    "p",
    {},
    "Click on a vehicle to select it, double click to follow it. Drag and wheel move the map. The address names the moment: copy it as a link.",
  );
  const dialog = element("dialog", { "aria-label": "Keys" }, element("h2", {}, "Keys"), table, mouse);
  dialog.append(button("Close", "Close", () => dialog.close()));
  return dialog;
}

const LAYERS: Record<string, keyof Layers> = {
  p: "plan",
  c: "candidates",
  r: "predictions",
  e: "all",
  v: "sight",
  m: "links",
  l: "labels",
};

export function listenToKeys(parts: Parts): void {
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const target = event.target;
    if (target instanceof HTMLInputElement && target.type === "search") return;
    if (target instanceof HTMLSelectElement || document.querySelector("dialog[open]")) return;
    // The space bar presses a focused button and checks a focused box; everywhere else it plays.
    const box = target instanceof HTMLInputElement && target.type === "checkbox";
    if (event.key === " " && (box || target instanceof HTMLButtonElement)) return;
    if (press(event.key, event.shiftKey, parts)) event.preventDefault();
  });
}

/** After a click with the mouse, the next key is meant for the page, not for the button or box again. */
export function focusAfterClicks(root: HTMLElement, map: RoadMap): void {
  let pointed = false;
  document.addEventListener("keydown", () => (pointed = false), true);
  document.addEventListener("pointerdown", () => (pointed = true), true);
  root.addEventListener("click", (event) => {
    const pressed = (event.target as Element).closest('button, input[type="checkbox"]');
    if (pointed && pressed !== null) map.root.focus({ preventScroll: true });
  });
}

function press(key: string, shift: boolean, { run, state, map, player, jump }: Parts): boolean {
  const second = Math.round(1 / run.header.dt);
  const moved = (dx: number, dy: number) => {
    state.follow = false;
    map.camera.pan(dx, dy);
    state.changed();
  };
  const actions: Record<string, () => void> = {
    " ": () => state.play(),
    ArrowLeft: () => state.stepBy(shift ? -second : -1),
    ArrowRight: () => state.stepBy(shift ? second : 1),
    Home: () => state.stepBy(-state.last - 1),
    End: () => state.stepBy(state.last + 1),
    ",": () => player.faster(-1),
    ".": () => player.faster(1),
    n: () => nextEvent(run, state, jump, 1),
    b: () => nextEvent(run, state, jump, -1),
    "[": () => nextAgent(run, state, -1),
    "]": () => nextAgent(run, state, 1),
    Escape: () => state.select(-1),
    f: () => {
      state.follow = !state.follow && state.selected >= 0;
      state.changed();
    },
    "+": () => map.zoom(1.4),
    "=": () => map.zoom(1.4),
    "-": () => map.zoom(1 / 1.4),
    "0": () => map.fit(),
    w: () => moved(0, 60),
    s: () => moved(0, -60),
    a: () => moved(60, 0),
    d: () => moved(-60, 0),
    A: () => document.querySelector<HTMLButtonElement>(".head button")!.click(),
    i: () => document.querySelector<HTMLButtonElement>(".tools .save")!.click(),
    t: () => {
      state.theme = state.theme === "light" ? "dark" : "light";
      state.changed();
    },
    "?": () => document.querySelector("dialog")!.showModal(),
  };
  const layer = LAYERS[key];
  if (layer !== undefined) {
    state.layers[layer] = !state.layers[layer];
    state.changed();
    return true;
  }
  const action = actions[key];
  action?.();
  return action !== undefined;
}

function nextEvent(run: Run, state: State, jump: (event: number) => void, way: 1 | -1): void {
  const { events } = run.header;
  // Several events may be at one time: from the one jumped to, the next one in the list follows.
  const within = events[state.event]?.step === state.step;
  const from = way > 0 ? events.findIndex((e) => e.step >= state.step) : events.findLastIndex((e) => e.step <= state.step);
  const found = within ? state.event + way : from;
  if (events[found] !== undefined) jump(found);
}

function nextAgent(run: Run, state: State, way: 1 | -1): void {
  const agents = run.header.participants.map((p, row) => (p.agent >= 0 ? row : -1)).filter((row) => row >= 0);
  if (!agents.length) return;
  const at = agents.indexOf(state.selected);
  const there = agents.filter((row) => run.present(row, state.step));
  if (at < 0 && there.length) {
    state.select(way > 0 ? there[0] : there[there.length - 1]);
    return;
  }
  state.select(agents[at < 0 ? (way > 0 ? 0 : agents.length - 1) : (at + way + agents.length) % agents.length]);
}
