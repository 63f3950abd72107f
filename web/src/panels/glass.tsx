import { Choice, Colour, Group, Slider } from "../controls";
import { change, optionsOf, useView } from "../store";
import { t } from "../strings";
import { number } from "./material";

function glass(options: Record<string, string | number | null>, key = ""): Promise<void> {
  return change("set", { kind: "glass", options }, key);
}

export function Glass() {
  const { state, glass: traced } = useView();
  const options = optionsOf(state, "glass") as Record<string, string>;
  const slide = (name: string) => (value: number | null) => glass({ [name]: value }, `glass ${name}`);
  const inside = String(options.hollow ?? "");
  const tint = /^#[0-9a-f]{6}$/i.test(options.tint ?? "") ? options.tint! : "#ffffff";
  return (
    <Group title={t.makeGlass}>
      {traced?.waiting && <p class="soft">{traced.words}</p>}
      {traced?.bad && <p class="warn">{traced.words}</p>}
      <Slider id="glass_ior" label={t.ior} low={1} high={2.5} step={0.01} value={number(options.ior, 1.5)} changed={slide("ior")} />
      <Slider id="glass_roughness" label={t.frosted} low={0} high={1} step={0.01} value={number(options.roughness)} changed={slide("roughness")} />
      <Slider
        id="glass_transmission"
        label={t.transmission}
        low={0}
        high={1}
        step={0.01}
        value={number(options.transmission, 1)}
        changed={slide("transmission")}
      />
      <Colour label={t.tint} value={tint} changed={(value) => glass({ tint: value === "#ffffff" ? null : value }, "glass tint")} />
      <Choice
        label={t.inside}
        value={inside === "open" ? "open" : inside && inside !== "false" ? "true" : ""}
        options={[["", t.solid], ["true", t.hollow], ["open", t.open]]}
        changed={(value) => glass({ hollow: value || null })}
      />
      <p class="soft">{t.glassHint}</p>
    </Group>
  );
}
