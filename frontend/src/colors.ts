// Colours for light and dark, told apart with every common kind of colour blindness; outcomes have shapes, too.

import { GOAL, ON_DARK, PREDICTION, STATIC, TRAFFIC } from "./contract";

export type Theme = "light" | "dark";

export interface Palette {
  background: string;
  surface: string;
  edge: string;
  marking: string;
  arrow: string;
  traffic: string;
  static: string;
  outline: string;
  ink: string;
  halo: string;
  nose: string;
  goal: string;
  prediction: string;
  rejected: string;
  chosen: string;
  radius: string;
  grid: string;
}

export const PALETTES: Record<Theme, Palette> = {
  light: {
    background: "#fafafa",
    surface: "#e4e4e4",
    edge: "#8f8f8f",
    marking: "#ffffff",
    arrow: "#c4c4c4",
    traffic: TRAFFIC,
    static: STATIC,
    outline: "#3c3c3c",
    ink: "#1d1d1d",
    halo: "rgba(255,255,255,0.85)",
    nose: "rgba(255,255,255,0.85)",
    goal: GOAL,
    prediction: PREDICTION,
    rejected: "#a89898",
    chosen: "#000000",
    radius: "#4a4a4a",
    grid: "#e0e0e0",
  },
  dark: {
    background: "#14171a",
    surface: "#2a2f34",
    edge: "#7d858c",
    marking: "#4c545b",
    arrow: "#454c53",
    traffic: "#767d84",
    static: "#9aa1a8",
    outline: "#e3e6e8",
    ink: "#eceff1",
    halo: "rgba(15,18,20,0.85)",
    nose: "rgba(15,18,20,0.8)",
    goal: "#56B4E9",
    prediction: "#d6a3ea",
    rejected: "#6d6464",
    chosen: "#ffffff",
    radius: "#b8bec4",
    grid: "#343a40",
  },
};

/** The colour of an agent or planner, which the header names for light ground. */
export function agentColor(color: string | undefined, theme: Theme): string {
  if (color === undefined) return PALETTES[theme].traffic;
  return theme === "dark" ? (ON_DARK[color] ?? color) : color;
}

// Viridis, at equal distances.
const VIRIDIS = ["#440154", "#482878", "#3e4989", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6ece58", "#b5de2b", "#fde725"];

/** Colour of a cost between 0 (cheap) and 1 (dear); what is cheap stands out. */
export function costColor(part: number, theme: Theme): string {
  const place = Math.min(1, Math.max(0, part)) * (VIRIDIS.length - 2);
  const at = theme === "light" ? place : VIRIDIS.length - 1 - place;
  const low = Math.min(VIRIDIS.length - 2, Math.floor(at));
  const channel = (hex: string, i: number) => parseInt(hex.slice(1 + 2 * i, 3 + 2 * i), 16);
  const mix = [0, 1, 2].map((i) => {
    const [a, b] = [channel(VIRIDIS[low], i), channel(VIRIDIS[low + 1], i)];
    return Math.round(a + (at - low) * (b - a));
  });
  return `rgb(${mix.join(",")})`;
}
