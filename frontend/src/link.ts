// Two pages side by side share clock, selection and place on the map. The page around them passes messages on.

import type { RoadMap } from "./map";
import type { Run } from "./run";
import type { State } from "./state";

interface Said {
  /** Time since the start of the scenario [s]. */
  seconds: number;
  /** Id of the selected participant; null: none. */
  selected: number | null;
  follow: boolean;
  /** Centre of the map in the world [m], and pixels per metre. */
  x: number;
  y: number;
  scale: number;
}

/** Tells the page around this one what the reader does, and does what the reader did in the other one. */
export function link(run: Run, state: State, map: RoadMap): void {
  if (window.parent === window) return;
  const [dt, first, origin] = [run.header.dt, run.header.first_time_step, run.header.origin];
  let known = "";
  const said = (): Said => ({
    seconds: (first + state.time) * dt,
    selected: run.header.participants[state.selected]?.id ?? null,
    follow: state.follow,
    x: map.camera.x + origin[0],
    y: map.camera.y + origin[1],
    scale: map.camera.scale,
  });
  state.onChange(() => {
    const now = JSON.stringify(said());
    // The first one is how the page begins.
    if (known !== "" && now !== known) window.parent.postMessage(now, "*");
    known = now;
  });
  window.addEventListener("message", (event) => {
    if (event.source !== window.parent || typeof event.data !== "string") return;
    const other = JSON.parse(event.data) as Said;
    state.playing = false;
    state.selected = run.header.participants.findIndex((p) => p.id === other.selected);
    state.follow = other.follow && state.selected >= 0;
    if (!state.follow) [map.camera.x, map.camera.y, map.camera.scale] = [other.x - origin[0], other.y - origin[1], other.scale];
    state.time = Math.min(state.last, Math.max(0, other.seconds / dt - first));
    known = JSON.stringify(said());
    state.changed();
  });
}
