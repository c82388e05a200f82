// The tables beside the map: agents, events, and what the run was made with.

import { agentColor } from "./colors";
import type { EVENT_KINDS, Participant, RunEvent } from "./contract";
import { button, element, text, toggle } from "./elements";
import { FlowPanel } from "./flows";
import { mark, markIcon } from "./marks";
import type { Run } from "./run";
import type { State } from "./state";

/** What else happens than ends. */
const GROUPS: Record<(typeof EVENT_KINDS)[number], string> = {
  emergency_braking: "emergencies",
  infeasible_plan: "emergencies",
  critical: "critical moments",
  violation: "broken rules",
  hold: "agreements to wait",
};

export class Panels {
  readonly root = element("aside", { class: "side" });
  private readonly agentRows = new Map<number, HTMLElement>();
  private readonly eventRows: HTMLElement[] = [];
  private readonly swatches: [HTMLElement, string | undefined][] = [];
  private readonly flows: FlowPanel | undefined;
  private marked = "";
  private theme = "";

  constructor(
    private readonly run: Run,
    private readonly state: State,
    private readonly jump: (event: number) => void,
  ) {
    const { events, flows, participants } = run.header;
    this.flows = flows && new FlowPanel(flows);
    const agents = participants.filter((p) => p.agent >= 0).length;
    const pages: [string, HTMLElement][] = [
      [`Agents (${agents})`, this.agents()],
      [`Events (${events.length})`, this.events()],
      ...(this.flows ? [["Traffic", this.flows.root] as [string, HTMLElement]] : []),
      ["Run", this.about()],
    ];
    const tabs = element("div", { class: "tabs", role: "tablist" });
    const show = (chosen: number) =>
      pages.forEach(([, page], i) => {
        page.hidden = i !== chosen;
        tabs.children[i].setAttribute("aria-selected", String(i === chosen));
      });
    const choose = (i: number) => {
      show(i);
      this.reveal();
    };
    tabs.append(...pages.map(([title], i) => button(title, title, () => choose(i), { role: "tab" })));
    this.root.append(tabs, ...pages.map(([, page]) => page));
    show(0);
  }

  draw(): void {
    const { state } = this;
    if (state.theme !== this.theme) {
      this.theme = state.theme;
      for (const [swatch, color] of this.swatches) swatch.style.background = agentColor(color, state.theme);
    }
    this.flows?.draw(this.run.seconds(state.step));
    const key = `${state.selected} ${state.step} ${state.event}`;
    if (key === this.marked) return;
    this.marked = key;
    for (const [row, line] of this.agentRows) line.classList.toggle("chosen", row === state.selected);
    this.run.header.events.forEach((event, i) => {
      this.eventRows[i].classList.toggle("now", event.step === state.step);
      this.eventRows[i].classList.toggle("past", event.step < state.step);
      this.eventRows[i].setAttribute("aria-current", String(i === state.event && event.step === state.step));
    });
  }

  /** Brings the rows of the selected agent and of the event jumped to into sight. */
  reveal(): void {
    this.agentRows.get(this.state.selected)?.scrollIntoView({ block: "nearest" });
    this.eventRows[this.state.event]?.scrollIntoView({ block: "nearest" });
  }

  private agents(): HTMLElement {
    const rows = this.run.header.participants.map((p, row) => ({ p, row })).filter(({ p }) => p.agent >= 0);
    const several = new Set(rows.map(({ p }) => p.planner)).size > 1;
    const ttc = this.run.header.measures.findIndex((m) => m.name === "ttc");
    const least = (p: Participant) => this.least(ttc, p.agent);
    const scored = rows.some(({ p }) => p.score != null);
    const followed = rows.some(({ p }) => p.ttc);
    const head = element("tr");
    const table = element("table", {}, element("thead", {}, head));
    const columns: [string, string, (p: Participant) => number | string][] = [
      ["agent", "id of the agent", (p) => p.id],
      ["outcome", "how it ended", (p) => p.outcome ?? ""],
      ["time [s]", "when it ended", (p) => p.end ?? 0],
      ...(followed ? [["TTC [s]", "least time to collision along lanes", least] as [string, string, (p: Participant) => number]] : []),
      ...(scored
        ? [["score", "score from 0 to 100", (p: Participant) => p.score ?? -1] as [string, string, (p: Participant) => number]]
        : []),
      ...(several ? [["planner", "its planner", (p: Participant) => p.planner ?? ""] as [string, string, (p: Participant) => string]] : []),
    ];
    columns.forEach(([name, title, key]) => {
      let up = false;
      const sort = () => {
        up = !up;
        rows.sort((a, b) => (key(a.p) < key(b.p) ? -1 : key(a.p) > key(b.p) ? 1 : a.p.id - b.p.id) * (up ? 1 : -1));
        table.append(...rows.map(({ row }) => this.agentRows.get(row)!));
      };
      head.append(element("th", {}, button(name, `${title}; click to sort`, sort)));
    });
    for (const { p, row } of rows) {
      const line = element("tr", { "data-agent": String(p.id) });
      const swatch = element("span", { class: "swatch" });
      this.swatches.push([swatch, p.color]);
      line.append(
        element(
          "td",
          {},
          button(String(p.id), `Select agent ${p.id}`, () => this.choose(row)),
          swatch,
        ),
        element("td", {}, markIcon(p.outcome ?? ""), mark(p.outcome ?? "").text),
        element("td", { class: "number" }, this.run.seconds(p.end ?? 0).toFixed(this.run.decimals)),
      );
      if (followed) line.append(element("td", { class: "number" }, p.ttc ?? ""));
      if (scored) line.append(element("td", { class: "number" }, p.score == null ? "" : (100 * p.score).toFixed(0)));
      if (several) line.append(element("td", {}, p.planner ?? ""));
      const agent = element("tbody", { class: "agent" }, line);
      const why = [p.reason ?? "", p.harm == null ? "" : `harm ${text(p.harm, 3)}`].filter(Boolean).join("; ");
      for (const said of [why, p.why && `score: ${p.why}`])
        if (said) agent.append(element("tr", { class: "why" }, element("td", { colspan: String(columns.length) }, said)));
      agent.addEventListener("click", (event) => {
        if (!(event.target instanceof HTMLButtonElement)) this.choose(row);
      });
      this.agentRows.set(row, agent);
      table.append(agent);
    }
    if (!rows.length) return element("div", { class: "page" }, element("p", { class: "hint" }, "This run has no agents."));
    return element("div", { class: "page" }, this.counts(), table);
  }

  /** How many ended how; a click shows only those. */
  private counts(): HTMLElement {
    const strip = element("div", { class: "chips" });
    const counts = new Map<string, number>();
    for (const p of this.run.header.participants) if (p.agent >= 0) counts.set(p.outcome ?? "", (counts.get(p.outcome ?? "") ?? 0) + 1);
    let only = "";
    for (const [outcome, count] of counts) {
      const chip = button(`${count} ${mark(outcome).text}`, `Show only agents with ${mark(outcome).text}`, () => {
        only = only === outcome ? "" : outcome;
        for (const [row, line] of this.agentRows) line.hidden = only !== "" && this.run.header.participants[row].outcome !== only;
        for (const other of strip.children) other.classList.toggle("on", other === chip && only !== "");
      });
      chip.prepend(markIcon(outcome));
      strip.append(chip);
    }
    return strip;
  }

  private choose(row: number): void {
    this.state.select(row === this.state.selected ? -1 : row);
  }

  private least(index: number, agent: number): number {
    if (index < 0) return Infinity;
    let found = Infinity;
    for (let step = 0; step < this.run.steps; step++) {
      const value = this.run.measure(index, agent, step);
      if (value < found) found = value;
    }
    return found;
  }

  private events(): HTMLElement {
    const list = element("ol", { class: "events" });
    const group = (event: RunEvent) => GROUPS[event.kind as keyof typeof GROUPS] ?? "ends";
    const hidden = new Set<string>();
    this.run.header.events.forEach((event, index) => {
      const time = element("span", { class: "time" }, this.run.time(event.step));
      const line = element(
        "li",
        {},
        button("", `Jump to: ${event.text}`, () => this.jump(index)),
      );
      line.firstElementChild!.append(time, markIcon(event.kind), element("span", {}, event.text));
      this.eventRows.push(line);
      list.append(line);
    });
    const filters = element("div", { class: "chips" });
    for (const name of new Set(this.run.header.events.map(group)))
      filters.append(
        toggle(name, `Show ${name}`, true, (on) => {
          if (on) hidden.delete(name);
          else hidden.add(name);
          this.run.header.events.forEach((event, i) => {
            this.eventRows[i].hidden = hidden.has(group(event));
          });
        }),
      );
    const page = element("div", { class: "page" }, filters, list);
    if (!this.run.header.events.length) page.append(element("p", { class: "hint" }, "No events."));
    return page;
  }

  private about(): HTMLElement {
    const { info, missing, benchmark_id, dt, n_steps } = this.run.header;
    const { settings: nested, ...choices } = info.settings ?? {};
    const facts: [string, unknown][] = [
      ["benchmark id", benchmark_id],
      ["time", `${n_steps} time steps of ${dt} s`],
      ["digest", info.digest],
      ...Object.entries(choices),
      ...Object.entries(info.versions ?? {}),
      ...Object.entries(info.platform ?? {}),
    ];
    const list = (rows: [string, unknown][]) => {
      const table = element("table", { class: "facts" });
      for (const [name, value] of rows) {
        const plain = typeof value === "string" ? value : JSON.stringify(value);
        table.append(element("tr", {}, element("th", {}, name), element("td", {}, plain ?? "")));
      }
      return table;
    };
    const all = list(Object.entries((nested as Record<string, unknown>) ?? {}));
    const filter = element("input", { type: "search", placeholder: "Find a setting", "aria-label": "Find a setting" });
    filter.addEventListener("input", () => {
      for (const row of all.rows) row.hidden = !row.textContent!.includes(filter.value.trim());
    });
    const page = element("div", { class: "page" }, list(facts));
    const lines = [...missing.map((m) => m.text), ...(info.notes ?? [])];
    if (lines.length) page.append(element("h2", {}, "Notes"), element("ul", {}, ...lines.map((l) => element("li", {}, l))));
    page.append(element("h2", {}, "Settings"), filter, all);
    return page;
  }
}
