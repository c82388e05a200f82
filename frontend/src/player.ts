// Play, pause, scrub, step, speed; marks of events above the slider.

import { button, element } from "./elements";
import { markIcon } from "./marks";
import type { Run } from "./run";
import type { State } from "./state";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8];

export class Player {
  readonly root = element("div", { class: "player" });
  private readonly slider = element("input", {
    type: "range",
    class: "scrub",
    min: "0",
    step: "1",
    "aria-label": "Time step",
  });
  private readonly clock = element("output", { class: "clock" });
  private readonly playButton: HTMLButtonElement;
  private readonly speed = element("select", { title: "Speed", "aria-label": "Speed" });
  private before = 0;

  constructor(
    private readonly run: Run,
    private readonly state: State,
    jump: (event: number) => void,
  ) {
    this.slider.max = String(state.last);
    this.slider.addEventListener("input", () => {
      state.playing = false;
      state.seek(Number(this.slider.value));
    });
    this.playButton = button("▶", "Play (space)", () => state.play(), { class: "play" });
    for (const speed of SPEEDS) this.speed.append(element("option", { value: String(speed) }, `${speed}×`));
    this.speed.value = "1";
    this.speed.addEventListener("change", () => (state.speed = Number(this.speed.value)));
    const track = element("div", { class: "track" }, this.marks(jump), this.slider);
    this.root.append(
      button("|◂", "To the start (Home)", () => state.stepBy(-state.last - 1)),
      button("◂", "One step back (←)", () => state.stepBy(-1)),
      this.playButton,
      button("▸", "One step forward (→)", () => state.stepBy(1)),
      button("▸|", "To the end (End)", () => state.stepBy(state.last + 1)),
      track,
      this.clock,
      this.speed,
    );
  }

  faster(by: number): void {
    const at = SPEEDS.indexOf(this.state.speed) + by;
    this.state.speed = SPEEDS[Math.min(SPEEDS.length - 1, Math.max(0, at))];
    this.speed.value = String(this.state.speed);
  }

  /** Moves time on while playing; `now` in milliseconds. */
  tick(now: number): void {
    const passed = Math.min(0.1, Math.max(0, (now - this.before) / 1000));
    this.before = now;
    if (!this.state.playing) return;
    const time = this.state.time + (passed * this.state.speed) / this.run.header.dt;
    if (time >= this.state.last) this.state.playing = false;
    this.state.seek(time);
  }

  draw(): void {
    const { state, run } = this;
    this.slider.value = String(state.step);
    this.slider.setAttribute("aria-valuetext", run.time(state.step));
    this.clock.textContent = `${run.time(state.step)} · step ${run.header.first_time_step + state.step}`;
    this.playButton.textContent = state.playing ? "❚❚" : "▶";
    this.playButton.classList.toggle("on", state.playing);
  }

  private marks(jump: (event: number) => void): HTMLElement {
    const strip = element("div", { class: "marks" });
    this.run.header.events.forEach((event, index) => {
      const tick = button("", event.text, () => jump(index), { class: `tick ${event.kind}`, tabindex: "-1" });
      tick.style.left = `${(100 * event.step) / Math.max(1, this.state.last)}%`;
      tick.append(markIcon(event.kind));
      strip.append(tick);
    });
    return strip;
  }
}
