import { useState } from "preact/hooks";
import { Colour, FileButton, Fold, Group, Slider, Switch } from "../controls";
import { drawn } from "../drawn";
import { PRESETS, type Preset } from "../presets";
import { change, optionsOf, useFile, useView, view } from "../store";
import { t } from "../strings";
import { Glass } from "./glass";

type Options = Record<string, string | number | null>;

/** A colour takes the place of a texture, and of how that lies. */
const NO_TEXTURE = { texture: null, texture_scale: null, texture_turn: null };

export function edit(options: Options, key = ""): Promise<void> {
  return change("set", { kind: "edit", options, quiet: drawn.material(options) }, key);
}

/** Shade the selection as a preset says; glass takes the place of another material, and the other way round. */
async function apply(preset: Preset): Promise<void> {
  const { state } = view;
  const current = state?.current ?? null;
  const kind = current === null ? "" : state!.steps[current]!.kind;
  if (current !== null && kind === "glass" && preset.kind === "edit")
    await change("act", { action: "remove", index: current });
  if (preset.kind === "edit") await edit(preset.options);
  else await change("set", { kind: preset.kind, options: preset.options }, "", t.working);
}

export function Material() {
  const { state, about } = useView();
  const selected = !!state?.stage.region;
  const current = state?.current == null ? undefined : state.steps[state.current];
  const isGlass = current?.kind === "glass";
  if (!selected && current?.kind !== "edit" && !isGlass)
    return (
      <div class="blank">
        <p>{t.selectFirst}</p>
        <p class="soft">{t.selectFirstHint}</p>
      </div>
    );
  return (
    <>
      <Group title={t.presets}>
        <div class="balls">
          {PRESETS.map((preset) => (
            <button key={preset.name} onClick={() => void apply(preset)} title={preset.name}>
              <img src={preset.ball} alt="" width={52} height={52} loading="lazy" />
              <span>{preset.name}</span>
            </button>
          ))}
        </div>
      </Group>
      {isGlass ? <Glass /> : about && <Plain />}
      <Removal />
    </>
  );
}

function Removal() {
  const [shadow, setShadow] = useState(true);
  const remove = () => change("set", { kind: "remove", options: shadow ? {} : { shadow: 0 } }, "", t.removing);
  return (
    <Fold title={t.takeAway}>
      <Switch id="shadow" label={t.shadowToo} on={shadow} changed={setShadow} />
      <button id="remove" class="wide" onClick={() => void remove()}>
        {t.takeAway}
      </button>
    </Fold>
  );
}

function Plain() {
  const { state } = useView();
  const options = optionsOf(state, "edit") as Record<string, string>;
  const fitted = state?.fitted;
  // An option that is not set, or is relative to what was found, shows what was found.
  const surface = (name: "roughness" | "metallic") => {
    const given = options[name];
    return given !== undefined && !"+-".includes(given[0]!) ? Number(given) : (fitted?.[name] ?? 0.5);
  };
  const slide = (name: string) => (value: number | null) => edit({ [name]: value }, name);
  const colour = /^#[0-9a-f]{6}$/i.test(options.albedo ?? "") ? options.albedo! : (fitted?.colour ?? "#808080");
  // A picked colour appears as it was picked: nothing turns or fades it.
  const pick = (value: string) =>
    void edit({ albedo: value, ...NO_TEXTURE, hue: null, saturation: null, value: null }, "albedo");
  const changed = ["albedo", "texture", "hue", "saturation", "value"].some((name) => name in options);
  return (
    <>
      <Group
        title={t.colour}
        more={
          changed && (
            <button
              class="link"
              onClick={() => void edit({ albedo: null, ...NO_TEXTURE, hue: null, saturation: null, value: null, detail: null })}
            >
              {t.ownColours}
            </button>
          )
        }
      >
        <Colour label={t.plain} value={colour} changed={pick} />
        <Slider id="hue" label={t.hue} unit="°" low={-180} high={180} step={1} value={number(options.hue)} changed={slide("hue")} />
        <Slider id="saturation" label={t.saturation} low={-1} high={1} step={0.02} value={number(options.saturation)} changed={slide("saturation")} />
        <Slider id="value" label={t.value} low={-1} high={1} step={0.02} value={number(options.value)} changed={slide("value")} />
        {("albedo" in options || "texture" in options) && (
          <Slider id="detail" label={t.detail} low={0} high={1} step={0.02} value={number(options.detail, 1)} changed={slide("detail")} />
        )}
      </Group>
      <Group
        title={t.surface}
        more={
          ("roughness" in options || "metallic" in options) && (
            <button class="link" onClick={() => void edit({ roughness: null, metallic: null })}>
              {t.asFitted}
            </button>
          )
        }
      >
        <Slider id="roughness" label={t.roughness} low={0} high={1} step={0.01} value={surface("roughness")} changed={slide("roughness")} />
        <Slider id="metallic" label={t.metallic} low={0} high={1} step={0.01} value={surface("metallic")} changed={slide("metallic")} />
      </Group>
      <Group title={t.texture}>
        <div class="row">
          <FileButton label={t.chooseTexture} accept="image/*,.exr,.hdr" chosen={(file) => void useFile(file, "texture")} />
          {"texture" in options && (
            <button class="quiet" onClick={() => void edit(NO_TEXTURE)}>
              {t.noTexture}
            </button>
          )}
        </div>
        {"texture" in options && (
          <>
            <Slider
              id="texture_scale"
              label={t.textureScale}
              low={0.1}
              high={4}
              step={0.05}
              value={number(options.texture_scale, 1)}
              changed={slide("texture_scale")}
            />
            <Slider
              id="texture_turn"
              label={t.textureTurn}
              unit="°"
              low={-180}
              high={180}
              step={1}
              value={number(options.texture_turn)}
              changed={slide("texture_turn")}
            />
          </>
        )}
      </Group>
      <Fold title={t.border} open={"grow" in options || "feather" in options}>
        <Slider id="grow" label={t.grow} low={-0.05} high={0.05} step={0.002} value={number(options.grow)} changed={slide("grow")} />
        <Slider id="feather" label={t.feather} low={0} high={0.1} step={0.002} value={number(options.feather)} changed={slide("feather")} />
      </Fold>
    </>
  );
}

export function number(text: unknown, fallback = 0): number {
  const value = Number(text);
  return text !== undefined && Number.isFinite(value) ? value : fallback;
}
