// The moment that a page shows, in its address: #t=3.5&agent=1006 opens it at 3.5 s with vehicle 1006 selected.

import type { RoadMap } from "./map";
import type { Run } from "./run";
import type { State } from "./state";

/** What an address asks for; missing: not asked for. */
export interface Moment {
  /** Time since the start of the scenario [s]. */
  seconds?: number;
  /** Id of the selected participant; null: none. */
  agent?: number | null;
}

export function readMoment(hash: string): Moment {
  const asked = new URLSearchParams(hash.replace(/^#/, ""));
  const found: Moment = {};
  const [time, agent] = [asked.get("t"), asked.get("agent")];
  if (time !== null && time.trim() !== "" && Number.isFinite(Number(time))) found.seconds = Number(time);
  if (agent !== null) found.agent = /^-?\d+$/.test(agent) ? Number(agent) : null;
  return found;
}

export function writeMoment(seconds: string, agent: number | null): string {
  return `#t=${seconds}${agent === null ? "" : `&agent=${agent}`}`;
}

/** Shows what the address asks for, also when it changes, and keeps the address up to date while the player stands. */
export function keepMoment(run: Run, state: State, map: RoadMap): void {
  // Pages beside each other share one address, notebooks have none.
  if (window.parent !== window) return;
  const [dt, first] = [run.header.dt, run.header.first_time_step];
  let written = "";
  const show = () => {
    if (window.location.hash === written) return;
    const { seconds, agent } = readMoment(window.location.hash);
    if (seconds === undefined && agent === undefined) return;
    state.playing = false;
    if (agent !== undefined) state.select(run.header.participants.findIndex((p) => p.id === agent));
    if (seconds !== undefined) state.seek(Math.round(seconds / dt) - first);
    if (state.selected >= 0) map.reveal(state.selected);
  };
  show();
  const start = [state.step, state.selected].join();
  state.onChange(() => {
    if (state.playing || (written === "" && [state.step, state.selected].join() === start)) return;
    const now = writeMoment(((first + state.step) * dt).toFixed(run.decimals), run.header.participants[state.selected]?.id ?? null);
    if (now === written) return;
    written = now;
    // A step in the history per moment would make "back" useless.
    window.history.replaceState(null, "", now);
  });
  window.addEventListener("hashchange", show);
}
