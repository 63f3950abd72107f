// Dark or light: as the system says, or as was chosen here, which is remembered.

export type Theme = "system" | "dark" | "light";

const KEY = "theme";
const SYSTEM = matchMedia("(prefers-color-scheme: light)");
const PAPER = { dark: "#17191d", light: "#f3f4f6" };

export function chosenTheme(): Theme {
  const kept = localStorage.getItem(KEY);
  return kept === "dark" || kept === "light" ? kept : "system";
}

/** What is seen. */
export function shownTheme(): "dark" | "light" {
  const chosen = chosenTheme();
  if (chosen !== "system") return chosen;
  return SYSTEM.matches ? "light" : "dark";
}

export function chooseTheme(theme: Theme): void {
  if (theme === "system") localStorage.removeItem(KEY);
  else localStorage.setItem(KEY, theme);
  apply();
}

function apply(): void {
  const theme = shownTheme();
  document.documentElement.dataset.theme = theme;
  document.querySelector("meta[name=theme-color]")?.setAttribute("content", PAPER[theme]);
}

export function watchTheme(): void {
  SYSTEM.addEventListener("change", apply);
  // Other tabs are of the same theme.
  window.addEventListener("storage", (event) => event.key === KEY && apply());
  apply();
}
