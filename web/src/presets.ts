// Materials to choose from; `balls.py` renders their thumbnails from the same values.
import ceramic from "./balls/ceramic.jpg";
import chrome from "./balls/chrome.jpg";
import copper from "./balls/copper.jpg";
import frosted from "./balls/frosted.jpg";
import glass from "./balls/glass.jpg";
import gold from "./balls/gold.jpg";
import matt from "./balls/matt.jpg";
import plastic from "./balls/plastic.jpg";
import rubber from "./balls/rubber.jpg";
import steel from "./balls/steel.jpg";

export interface Preset {
  name: string;
  ball: string;
  kind: "edit" | "glass";
  options: Record<string, string | number | null>;
}

/** A material of one colour; null keeps the thing's own colours. */
function paint(name: string, ball: string, albedo: string | null, metallic: number, roughness: number): Preset {
  const plain = { texture: null, texture_scale: null, texture_turn: null, hue: null, saturation: null, value: null };
  return { name, ball, kind: "edit", options: { ...plain, albedo, metallic, roughness } };
}

export const PRESETS: Preset[] = [
  paint("Gold", gold, "#ffdb93", 1, 0.14),
  paint("Copper", copper, "#f7baa2", 1, 0.2),
  paint("Chrome", chrome, "#eeeff0", 1, 0.03),
  paint("Brushed steel", steel, "#bfc0c2", 1, 0.36),
  paint("Ceramic", ceramic, "#eeece7", 0, 0.12),
  paint("Plastic", plastic, "#ce4c47", 0, 0.3),
  paint("Rubber", rubber, "#2d2d31", 0, 0.6),
  paint("Matt", matt, null, 0, 0.95),
  { name: "Glass", ball: glass, kind: "glass", options: { roughness: 0 } },
  { name: "Frosted", ball: frosted, kind: "glass", options: { roughness: 0.3 } },
];
