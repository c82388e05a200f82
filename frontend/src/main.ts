// The page: reads what is written into it, puts the parts together, draws when something has changed.

import "uplot/dist/uPlot.min.css";
import "./report.css";
import { showBatch } from "./batch";
import { type BatchHeader, FORMAT, type RunHeader } from "./contract";
import { Detail } from "./detail";
import { button, element, toggle } from "./elements";
import { focusAfterClicks, helpDialog, listenToKeys } from "./keys";
import { link } from "./link";
import { RoadMap } from "./map";
import { keepMoment } from "./moment";
import { Panels } from "./panels";
import { savePicture } from "./picture";
import { Player } from "./player";
import { Run } from "./run";
import { State } from "./state";

async function start(root: HTMLElement): Promise<void> {
  const header = JSON.parse(document.getElementById("header")!.textContent!) as RunHeader | BatchHeader;
  if (header.format !== FORMAT) throw new Error(`this page holds format ${header.format}, not ${FORMAT}`);
  const arrays = document.getElementById("arrays")!.textContent!;
  document.getElementById("arrays")!.remove();
  if (header.kind === "batch") await showBatch(root, header, arrays);
  else await showRun(root, header, arrays);
}

async function showRun(root: HTMLElement, header: RunHeader, arrays: string): Promise<void> {
  const run = await Run.read(header, arrays);
  const state = new State(run);
  state.theme = window.matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";

  const map = new RoadMap(run, state);
  const jump = (index: number) => {
    const event = header.events[index];
    state.playing = false;
    state.selected = event.rows[0];
    state.event = index;
    state.seek(event.step);
    map.reveal(event.rows[0]);
    panels.reveal();
  };
  const player = new Player(run, state, jump);
  const panels = new Panels(run, state, jump);
  const detail = new Detail(run, state);
  const help = helpDialog();
  root.replaceChildren(
    headline(run, state, () => help.showModal()),
    mapArea(map, state, () => savePicture(run, state, map)),
    player.root,
    detail.root,
    panels.root,
    help,
  );
  listenToKeys({ run, state, map, player, jump });
  focusAfterClicks(root, map);
  link(run, state, map);
  keepMoment(run, state, map);

  let dirty = true;
  state.onChange(() => (dirty = true));
  const draw = () => {
    dirty = false;
    document.documentElement.dataset.theme = state.theme;
    document.documentElement.style.setProperty("--zoom", String(state.zoom));
    map.draw();
    player.draw();
    panels.draw();
    detail.draw();
    mirror(root, state);
  };
  map.resize();
  draw();
  const frame = (now: number) => {
    player.tick(now);
    if (dirty) draw();
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
}

/** For tests and other programs that read the page. */
function mirror(root: HTMLElement, state: State): void {
  const said: Record<string, string> = {
    ready: "true",
    step: String(state.step),
    playing: String(state.playing),
    selected: state.selected < 0 ? "" : String(state.run.header.participants[state.selected].id),
    follow: String(state.follow),
  };
  for (const [name, value] of Object.entries(said)) if (root.dataset[name] !== value) root.dataset[name] = value;
}

function headline(run: Run, state: State, help: () => void): HTMLElement {
  const agents = run.header.participants.filter((p) => p.agent >= 0);
  const sumo = run.header.participants.filter((p) => p.name !== undefined).length;
  const others = run.n - agents.length - sumo;
  const seconds = (run.steps - 1) * run.header.dt;
  const bySumo = sumo ? `${sumo} by SUMO, ` : "";
  const said = `${agents.length} agents, ${bySumo}${others} recorded, ${seconds.toFixed(run.decimals)} s`;
  const sizes = [1, 1.25, 1.5];
  return element(
    "header",
    { class: "head" },
    element("h1", {}, run.header.name),
    element("span", { class: "said" }, said),
    element("span", { class: "digest", title: `digest ${run.header.info.digest}` }, run.header.info.digest.slice(0, 12)),
    element("span", { class: "space" }),
    button("A+", "Larger text and lines, for a projector (Shift+A)", () => {
      state.zoom = sizes[(sizes.indexOf(state.zoom) + 1) % sizes.length];
      state.changed();
    }),
    button("◐", "Light or dark (T)", () => {
      state.theme = state.theme === "light" ? "dark" : "light";
      state.changed();
    }),
    button("?", "Keys (?)", help),
  );
}

function mapArea(map: RoadMap, state: State, save: () => void): HTMLElement {
  const labels = toggle("ids", "Ids of agents (L)", true, (on) => {
    state.layers.labels = on;
    state.changed();
  });
  const tools = element(
    "div",
    { class: "tools" },
    button("+", "Zoom in (+)", () => map.zoom(1.4)),
    button("−", "Zoom out (−)", () => map.zoom(1 / 1.4)),
    button("⤢", "Show everything (0)", () => map.fit()),
    button("⤓", "Save the map as a picture (I)", save, { class: "save" }),
    labels,
  );
  return element("div", { class: "map-area" }, map.root, tools);
}

const root = document.getElementById("report")!;
start(root).catch((cause: unknown) => {
  root.replaceChildren(element("p", { class: "failure" }, `This page cannot be shown: ${cause}`));
  throw cause;
});
