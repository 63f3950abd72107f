import { render } from "preact";
import { App } from "./app";
import { begin } from "./store";
import { watchTheme } from "./theme";
import "./style.css";
import "./panels.css";

watchTheme();
render(<App />, document.getElementById("app")!);
void begin();
