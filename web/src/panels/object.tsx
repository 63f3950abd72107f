import { Choice, Colour, FileButton, Fold, Group, Slider } from "../controls";
import { drawn } from "../drawn";
import { change, optionsOf, set, useFile, useView } from "../store";
import { t } from "../strings";
import { number } from "./material";

export function thing(options: Record<string, string | number | null>, key = ""): Promise<void> {
  const quiet = Object.keys(options).join() === "scale" && drawn.thing(options);
  return change("set", { kind: "insert", options, quiet }, key);
}

export function Things() {
  const { state, about } = useView();
  const options = optionsOf(state, "insert") as Record<string, string>;
  const shape = /^thing-([a-z]+)\.ply$/.exec(String(options.mesh ?? ""))?.[1] ?? "";
  const material = String(options.material ?? "as-is");
  const named = ["as-is", "glass", "mirror"].includes(material);
  const colour = /^#[0-9a-f]{6}$/i.test(material) ? material : "#c2563a";
  const current = state?.current == null ? undefined : state.steps[state.current];
  const fallen = current?.kind === "drop";
  return (
    <>
      <Group title={t.shapes}>
        <div class="shapes">
          {about?.objects.map((name) => (
            <button
              key={name}
              aria-pressed={shape === name.toLowerCase()}
              onClick={() => {
                set({ tool: "place" });
                void change("object", { name });
              }}
            >
              <Shape name={name} />
              <span>{name}</span>
            </button>
          ))}
        </div>
        <FileButton
          label={t.ownMesh}
          accept={about?.meshes.join(",") ?? ""}
          chosen={(file) => void useFile(file, "mesh").then(() => set({ tool: "place" }))}
        />
        <p class="soft">{t.placeHint}</p>
      </Group>
      {"mesh" in options && (
        <>
          <Group title={t.size}>
            <Slider id="scale" label={t.size} low={0.1} high={5} step={0.05} value={number(options.scale, 1)} changed={(value) => thing({ scale: value }, "scale")} />
            {!fallen && (
              <Slider id="turn" label={t.turn} unit="°" low={-180} high={180} step={1} value={number(options.turn)} changed={(value) => thing({ turn: value }, "turn")} />
            )}
          </Group>
          {!shape && !fallen && (
            <Group title={t.upAxis}>
              <Choice
                label={t.upAxis}
                value={String(options.up ?? "auto")}
                options={[["auto", t.upAuto], ["y", "Y"], ["z", "Z"]]}
                changed={(value) => thing({ up: value === "auto" ? null : value })}
              />
            </Group>
          )}
          <Group title={t.madeOf}>
            <Choice
              label={t.madeOf}
              value={named ? material : "colour"}
              options={[["as-is", t.asIs], ["glass", t.glass], ["mirror", t.mirror], ["colour", t.plain]]}
              changed={(value) => thing({ material: value === "colour" ? colour : value })}
            />
            {!named && <Colour label={t.colour} value={colour} changed={(value) => thing({ material: value }, "material")} />}
          </Group>
          <Fold title={t.fall}>
            <Fall />
          </Fold>
        </>
      )}
    </>
  );
}

function Fall() {
  const { state } = useView();
  const options = optionsOf(state, "insert") as Record<string, string>;
  const height = number(options.height, 1.5);
  return (
    <>
      <Slider id="height" label={t.height} low={0} high={5} step={0.1} value={height} changed={(value) => change("fall", { height: value ?? 1.5 }, "fall", t.falling)} />
      <button class="wide" id="rest" onClick={() => void change("fall", { height }, "", t.falling)}>
        {t.fall}
      </button>
    </>
  );
}

const SHAPES: Record<string, string> = {
  Ball: "M14 4a10 10 0 1 1 0 20 10 10 0 0 1 0-20zM8 11a7 7 0 0 1 5-4",
  Cube: "M14 3l9 5v11l-9 5-9-5V8zM5 8l9 5 9-5M14 13v11",
  Cylinder: "M6 7c0-4 16-4 16 0v14c0 4-16 4-16 0zM6 7c0 4 16 4 16 0",
  Cone: "M14 3L5 21c0 4.500 18 4.500 18 0z",
  Ring: "M14 8c6 0 11 2.500 11 6s-5 6-11 6S3 17.500 3 14s5-6 11-6zM14 12c3 0 5 .800 5 2s-2 2-5 2-5-.800-5-2 2-2 5-2z",
  Slab: "M14 9l11 4.500-11 4.500L3 13.500zM3 13.500v3L14 21l11-4.500v-3",
};

function Shape({ name }: { name: string }) {
  return (
    <svg class="shape" viewBox="0 0 28 28" aria-hidden="true">
      <path d={SHAPES[name] ?? SHAPES.Cube} />
    </svg>
  );
}
