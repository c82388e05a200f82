// What the reader has chosen. Every change is announced to the listeners; the next frame draws it.

import type { Theme } from "./colors";
import type { Run } from "./run";

export interface Layers {
  labels: boolean;
  plan: boolean;
  candidates: boolean;
  predictions: boolean;
  /** Predictions of all participants in view, not only of conflict partners. */
  all: boolean;
  sight: boolean;
  /** Plans that the selected agent has received, and bars before which agents hold. */
  links: boolean;
}

export class State {
  /** Time steps since the first one; between two while playing. */
  time = 0;
  playing = false;
  speed = 1;
  /** Row of the selected participant; -1: none. */
  selected = -1;
  /** Index of the event that was jumped to last; -1: none. */
  event = -1;
  follow = false;
  theme: Theme = "light";
  /** Size of text and lines. */
  zoom = 1;
  layers: Layers = { labels: true, plan: true, candidates: true, predictions: true, all: false, sight: true, links: true };
  private readonly listeners: (() => void)[] = [];

  constructor(readonly run: Run) {}

  get step(): number {
    return Math.min(this.run.steps - 1, Math.floor(this.time + 1e-6));
  }

  get last(): number {
    return this.run.steps - 1;
  }

  onChange(listener: () => void): void {
    this.listeners.push(listener);
  }

  changed(): void {
    for (const listener of this.listeners) listener();
  }

  seek(time: number): void {
    this.time = Math.min(this.last, Math.max(0, time));
    this.changed();
  }

  /** To whole steps, and stands still. */
  stepBy(steps: number): void {
    this.playing = false;
    this.seek(Math.round(this.time) + steps);
  }

  play(on = !this.playing): void {
    if (on && this.time >= this.last - 1e-6) this.time = 0;
    if (!on) this.time = Math.min(this.last, Math.round(this.time));
    this.playing = on;
    this.changed();
  }

  select(row: number): void {
    this.selected = row;
    if (row < 0) this.follow = false;
    this.changed();
  }
}
