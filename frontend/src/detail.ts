// The selected participant: its name, its layers, and its profiles.

import { agentColor, costColor } from "./colors";
import { button, element, text, toggle } from "./elements";
import { mark, markIcon } from "./marks";
import { Profiles } from "./profiles";
import type { Run } from "./run";
import type { Layers, State } from "./state";
import { costRange } from "./traffic";

/** Which layer lacks something where a part of the run is missing. */
const LAYER_OF: Record<string, keyof Layers> = {
  plans: "plan",
  candidates: "candidates",
  predictions: "predictions",
  views: "sight",
  links: "links",
};

export class Detail {
  readonly root = element("section", { class: "detail", "aria-label": "Selected vehicle" });
  private readonly name = element("div", { class: "title" });
  private readonly now = element("div", { class: "now-line" });
  private readonly legend = element("div", { class: "cost" });
  private readonly profiles: Profiles;
  private readonly follow: HTMLInputElement;
  private shown = "";

  constructor(
    private readonly run: Run,
    private readonly state: State,
  ) {
    this.profiles = new Profiles(run, state);
    const layers = element("div", { class: "chips" });
    const follow = toggle("follow", "The map follows the vehicle (F)", false, (on) => {
      state.follow = on;
      state.changed();
    });
    this.follow = follow.querySelector("input")!;
    layers.append(follow);
    const kinds: [keyof Layers, string, string, boolean][] = [
      ["plan", "plan", "The chosen plan (P)", !run.header.missing.some((m) => m.what === "plans")],
      ["candidates", "candidates", "Sampled candidates, coloured by cost (C)", run.has("candidate_x")],
      ["predictions", "predictions", "The predictions used for its plan, with 95 % ellipses of at most 8 m (R)", run.has("prediction_x")],
      ["all", "of all", "Predictions of all participants that it sees, not only of its conflict partners (E)", run.has("prediction_x")],
      [
        "links",
        "V2X",
        "Plans that it has received by V2X, darker the newer, dashed if the last message was lost; bars before which agents hold (M)",
        run.has("link_rows") || run.has("bar_rows"),
      ],
      ["sight", "view", "Its sensor radius; participants that it does not see are pale (V)", true],
    ];
    for (const [layer, label, title, there] of kinds) {
      const box = toggle(label, there ? title : `${title}: not recorded`, state.layers[layer], (on) => {
        state.layers[layer] = on;
        state.changed();
      });
      box.querySelector("input")!.disabled = !there;
      box.querySelector("input")!.dataset.layer = layer;
      box.classList.toggle("absent", !there);
      layers.append(box);
    }
    const head = element("div", { class: "detail-head" }, this.name, layers, this.legend);
    head.append(button("✕", "Clear the selection (Esc)", () => state.select(-1), { class: "close" }));
    this.root.append(head, this.now, this.profiles.root);
  }

  draw(): void {
    const { state, run } = this;
    this.root.hidden = state.selected < 0;
    if (state.selected < 0) return;
    this.follow.checked = state.follow;
    for (const box of this.root.querySelectorAll<HTMLInputElement>("input[data-layer]"))
      box.checked = state.layers[box.dataset.layer as keyof Layers] && !box.disabled;
    const p = run.header.participants[state.selected];
    const key = `${state.selected} ${state.theme}`;
    if (key !== this.shown) {
      this.shown = key;
      const swatch = element("span", { class: "swatch" });
      swatch.style.background = agentColor(p.color, state.theme);
      this.name.replaceChildren(
        swatch,
        element("strong", {}, `${p.agent >= 0 ? "Agent" : "Vehicle"} ${p.id}${p.name ? ` (${p.name})` : ""}`),
      );
      this.name.append(p.agent < 0 ? `${p.kind.replace("_", " ")}, recorded` : `${p.kind.replace("_", " ")}, ${p.planner}`);
      if (p.agent >= 0) {
        const end = `${mark(p.outcome ?? "").text} at ${run.time(p.end ?? 0)}`;
        this.name.append(element("span", { class: "end" }, markIcon(p.outcome ?? ""), end));
      }
    }
    this.now.textContent = this.sentence();
    this.drawLegend();
    this.profiles.draw();
  }

  /** What the agent is about at the current time. */
  private sentence(): string {
    const { state, run } = this;
    const p = run.header.participants[state.selected];
    const ended = state.step >= (p.end ?? Infinity) ? (p.reason ?? "") : "";
    if (!run.present(state.selected, state.step))
      return state.step > (p.end ?? Infinity) ? ended || "Its drive has ended." : "It is not present at this time.";
    const parts = ended ? [ended] : [];
    const plan = run.plan(state.selected, state.step);
    if (plan >= 0) {
      const status = run.header.statuses[run.table("plan_status")[plan]];
      const cost = run.table("plan_cost")[plan];
      parts.push(`plan: ${status.replace("_", " ")}${Number.isFinite(cost) ? `, cost ${text(cost, 3)}` : ""}`);
    }
    const side = run.turn(state.selected, state.step);
    if (Math.abs(side) === 1) parts.push(`shows ${side > 0 ? "left" : "right"}`);
    const seen = p.agent >= 0 ? run.seen(state.selected, state.step) : undefined;
    if (seen !== undefined) parts.push(`sees ${seen.size}`);
    const links = run.links(state.selected, state.step);
    if (links.length) {
      const oldest = Math.max(...links.map((link) => link.age)) * run.header.dt;
      parts.push(`has ${links.length} received plan${links.length > 1 ? "s" : ""}, the oldest of ${oldest.toFixed(1)} s ago`);
    }
    for (const { holding, going } of run.bars(state.step))
      if (holding === state.selected) parts.push(going < 0 ? "leaves the way to others" : `holds for ${run.header.participants[going].id}`);
    const [first, last] = run.candidates(state.selected, state.step);
    const at = run.table("candidate_step")[first];
    if (last > first) parts.push(`${last - first} candidates ${at === state.step ? "shown" : `of ${run.time(at)} shown`}`);
    const made = run.madeAt(state.selected, state.step);
    if (made < state.step && run.has("prediction_x")) parts.push(`predictions of ${run.time(made)} shown`);
    const lacking = run.header.missing.filter((m) => state.layers[LAYER_OF[m.what]]).map((m) => m.text);
    return [parts.join(" · "), ...(p.agent >= 0 ? lacking : [])].filter(Boolean).join("  —  ");
  }

  private drawLegend(): void {
    const { state, run } = this;
    const [first, last] = run.candidates(state.selected, state.step);
    const range = state.layers.candidates && last > first ? costRange(run, first, last) : undefined;
    // Its place stays, so that nothing moves.
    this.legend.style.visibility = range === undefined ? "hidden" : "visible";
    if (range === undefined) return;
    const stops = Array.from({ length: 9 }, (_, i) => costColor(i / 8, state.theme)).join(",");
    const bar = element("span", { class: "bar" });
    bar.style.background = `linear-gradient(to right,${stops})`;
    const high = element("span", {}, `${range[1].toFixed(2)}+`);
    this.legend.replaceChildren("cost ", element("span", {}, range[0].toFixed(2)), bar, high);
  }
}
