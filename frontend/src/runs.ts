// The list of runs with links to their pages.

import type { BatchHeader, BatchRun, Part } from "./contract";
import { button, dropEmptyColumns, element, NUMBER } from "./elements";

/** Headings of columns of numbers in the list of runs. */
const NUMBERS = new Set(["seed", "agents", "reached %", "collisions", "min TTC [s]"]);

/** All runs; a word in the field keeps those that contain it, a click on a heading sorts. */
export class RunList {
  readonly root = element("section");
  private readonly lines: { run: BatchRun; line: HTMLElement }[];
  private readonly count = element("span", { class: "hint" });
  private readonly filter = element("input", {
    type: "search",
    placeholder: "Find runs: scenario, planner, outcome, status",
    "aria-label": "Find runs",
  });
  private inside: (part: Part) => boolean = () => true;

  constructor(header: BatchHeader) {
    const keys: [string, (run: BatchRun) => number | string][] = [
      ["scenario", (run) => `${run.scenario} ${String(run.agent ?? "").padStart(12)}`],
      ["category", (run) => run.category],
      ["planner", (run) => run.variant],
      ["seed", (run) => run.seed],
      ["status", (run) => run.status],
      ["agents", (run) => run.n_agents],
      ["reached %", (run) => (run.outcomes.goal_reached ?? 0) / Math.max(1, run.n_agents)],
      ["collisions", (run) => run.outcomes.collision ?? 0],
      ["min TTC [s]", (run) => run.ttc_min ?? Infinity],
      ["", () => 0],
    ];
    const body = element("tbody");
    this.lines = header.runs.map((run) => ({ run, line: line(run) }));
    const head = element("tr");
    for (const [name, key] of keys) {
      let up = false;
      const sort = () => {
        up = !up;
        this.lines.sort(({ run: a }, { run: b }) => (key(a) < key(b) ? -1 : key(a) > key(b) ? 1 : 0) * (up ? 1 : -1));
        body.append(...this.lines.map(({ line: l }) => l));
      };
      head.append(element("th", NUMBERS.has(name) ? NUMBER : {}, name ? button(name, `Sort by ${name}`, sort) : ""));
    }
    body.append(...this.lines.map(({ line: l }) => l));
    this.filter.addEventListener("input", () => this.show());
    const table = dropEmptyColumns(element("table", { class: "runs" }, element("thead", {}, head), body));
    this.root.append(this.filter, this.count, element("div", { class: "scroll" }, table));
  }

  restrict(inside: (part: Part) => boolean): void {
    this.inside = inside;
    this.show();
  }

  private show(): void {
    const words = this.filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    for (const { run, line: l } of this.lines) {
      const said = [run.scenario, run.agent ?? "", run.category, run.variant, run.status, ...Object.keys(run.outcomes)]
        .join(" ")
        .toLowerCase();
      l.hidden = !this.inside(run) || !words.every((word) => said.includes(word));
      shown += Number(!l.hidden);
    }
    this.count.textContent = `${shown} of ${this.lines.length} runs`;
  }
}

/** A path as a link: folders may have # or ? in their names. */
function address(page: string): string {
  return page.split("/").map(encodeURIComponent).join("/");
}

function line(run: BatchRun): HTMLElement {
  const title = run.agent === null ? run.scenario : `${run.scenario}, agent ${run.agent}`;
  const name = run.page === null ? title : element("a", { href: address(run.page) }, title);
  const finished = run.status === "finished";
  const status = element("td", {}, run.status);
  for (const said of [run.error, run.damage]) if (said) status.append(element("small", {}, said));
  return element(
    "tr",
    { class: finished ? "" : "lost" },
    element("td", {}, name),
    element("td", {}, run.category),
    element("td", {}, run.variant),
    element("td", NUMBER, String(run.seed)),
    status,
    element("td", NUMBER, String(run.n_agents)),
    element("td", NUMBER, finished ? ((100 * (run.outcomes.goal_reached ?? 0)) / Math.max(1, run.n_agents)).toFixed(0) : ""),
    element("td", NUMBER, finished ? String(run.outcomes.collision ?? 0) : ""),
    element("td", NUMBER, run.ttc),
    element("td", {}, look(run)),
  );
}

/** The page of a run, or how to get one. */
function look(run: BatchRun): HTMLElement | string {
  if (run.page !== null) return element("a", { href: address(run.page) }, "look");
  if (run.command === undefined) return "";
  const how =
    run.command === null
      ? [
          "`interdrive run` cannot repeat this run. ",
          element("code", {}, "interdrive batch ... --keep all"),
          " into a new folder keeps it.",
        ]
      : [element("code", {}, run.command)];
  return element("details", {}, element("summary", {}, run.damage ? "damaged" : "not kept"), ...how);
}
