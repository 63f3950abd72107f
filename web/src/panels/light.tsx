import { useRef } from "preact/hooks";
import { address } from "../api";
import { FileButton, Group, Slider } from "../controls";
import { Icon } from "../icons";
import { lampsOf, setLamp } from "../marks";
import { change, optionsOf, set, useFile, useView } from "../store";
import { t } from "../strings";
import { number } from "./material";

type Options = Record<string, string | number | number[] | null>;

function light(options: Options, key = ""): Promise<void> {
  return change("set", { kind: "relight", options, coarse: !!key }, key);
}

export function Light() {
  const { state, about, lamp, tool } = useView();
  const options = optionsOf(state, "relight") as Record<string, string>;
  const chosen = /light-([a-z]+)\.exr/.exec(options.envmap ?? "")?.[1] ?? (options.envmap ? "own" : "");
  const lamps = lampsOf(options);
  const slide = (name: string) => (value: number | null) => light({ [name]: value }, `light ${name}`);
  return (
    <>
      <Group title={t.environment}>
        <div class="lights" role="radiogroup" aria-label={t.environment}>
          <button role="radio" aria-checked={!chosen} onClick={() => void change("light", { name: null })}>
            <img src={address(`picture/${state?.project?.name}/photo`)} alt="" />
            <span>{t.ownLight}</span>
          </button>
          {about?.lights.map((name) => (
            <button
              key={name}
              role="radio"
              aria-checked={chosen === name.toLowerCase()}
              onClick={() => void change("light", { name }, "light", t.working)}
            >
              <img src={address(`light/${name}`)} alt="" loading="lazy" />
              <span>{name}</span>
            </button>
          ))}
        </div>
        <FileButton label={t.ownMap} accept=".exr,.hdr,.png,.jpg,.jpeg" chosen={(file) => void useFile(file, "envmap")} />
        <Slider id="rotate" label={t.rotate} unit="°" low={-180} high={180} step={1} value={number(options.rotate)} changed={slide("rotate")} />
        <Slider id="ambient" label={t.ambient} low={0} high={2} step={0.02} value={number(options.ambient, 1)} changed={slide("ambient")} />
        <Slider id="dim" label={t.dim} low={0} high={2} step={0.02} value={number(options.dim, 1)} changed={(value) => light({ dim: value === 1 ? null : value }, "light dim")} />
      </Group>
      <Sun options={options} />
      <Group
        title={t.lamps}
        more={
          <button class="link" onClick={() => set({ tool: "lamp" })}>
            {t.addLamp}
          </button>
        }
      >
        {!lamps.length && <p class="soft">{t.lampHint}</p>}
        {lamps.map((one, index) => (
          <Lamp key={index} lamp={one} index={index} />
        ))}
        {lamps.length > 1 && (
          <button class="quiet" onClick={() => void light({ lamps: null })}>
            {t.noLamps}
          </button>
        )}
        {tool === "lamp" && (
          <div class="card" id="next-lamp">
            <b>{t.nextLamp}</b>
            <Slider label={t.kelvin} unit=" K" low={1700} high={12000} step={100} value={lamp.kelvin} changed={(value) => set({ lamp: { ...lamp, kelvin: value ?? 2700 } })} />
            <Slider label={t.strength} low={0.05} high={5} step={0.05} value={lamp.power} changed={(value) => set({ lamp: { ...lamp, power: value ?? 1 } })} />
            <Slider label={t.nearness} low={0.2} high={0.98} step={0.01} value={lamp.before} changed={(value) => set({ lamp: { ...lamp, before: value ?? about?.lamp_share ?? 0.75 } })} />
          </div>
        )}
      </Group>
    </>
  );
}

function Lamp({ lamp, index }: { lamp: number[]; index: number }) {
  const [x = 0, y = 0, depth = 1, kelvin = 2700, power = 1] = lamp;
  return (
    <div class="card">
      <header>
        <b>{t.lampNumber(index + 1)}</b>
        <button class="icon-only" aria-label={`${t.removeLamp}: ${index + 1}`} title={t.removeLamp} onClick={() => setLamp(index, null)}>
          <Icon name="bin" />
        </button>
      </header>
      <Slider label={t.kelvin} unit=" K" low={1700} high={12000} step={100} value={kelvin} changed={(value) => setLamp(index, [x, y, depth, value ?? 2700, power])} />
      <Slider label={t.strength} low={0.05} high={5} step={0.05} value={power} changed={(value) => setLamp(index, [x, y, depth, kelvin, value ?? 1])} />
      <Slider label={t.distance} low={0.1} high={Math.max(4, depth * 1.5)} step={0.05} value={depth} changed={(value) => setLamp(index, [x, y, value ?? depth, kelvin, power])} />
    </div>
  );
}

const SUN: [number, number] = [45, 40];

function Sun({ options }: { options: Record<string, unknown> }) {
  const on = options.sun !== undefined;
  const [azimuth, elevation] = on ? String(options.sun).split(",").map(Number) as [number, number] : SUN;
  const move = (az: number, el: number, key = "sun") => light({ sun: [Math.round(az), Math.round(el)] }, key);
  return (
    <Group
      title={t.sun}
      more={
        <label class="switch">
          <input
            type="checkbox"
            role="switch"
            aria-label={t.sunOn}
            checked={on}
            onChange={(event) => light(event.currentTarget.checked ? { sun: SUN } : { sun: null, sun_power: null })}
          />
          <i />
        </label>
      }
    >
      {on && (
        <>
          <SunPad azimuth={azimuth} elevation={elevation} moved={move} />
          <Slider id="azimuth" label={t.azimuth} unit="°" low={-180} high={180} step={1} value={azimuth} changed={(value) => move(value ?? SUN[0], elevation)} />
          <Slider id="elevation" label={t.elevation} unit="°" low={0} high={90} step={1} value={elevation} changed={(value) => move(azimuth, value ?? SUN[1])} />
          <Slider id="sun_power" label={t.strength} low={0} high={5} step={0.05} value={number(options.sun_power, 1)} changed={(value) => light({ sun_power: value }, "sun power")} />
        </>
      )}
    </Group>
  );
}

/** The sky from below: ahead is up, the middle overhead. */
function SunPad({ azimuth, elevation, moved }: { azimuth: number; elevation: number; moved: (az: number, el: number) => void }) {
  const pad = useRef<SVGSVGElement>(null);
  const far = 42 * (1 - elevation / 90);
  const angle = (azimuth * Math.PI) / 180;
  const drag = (event: PointerEvent) => {
    const bounds = pad.current!.getBoundingClientRect();
    const x = ((event.clientX - bounds.left) / bounds.width) * 100 - 50;
    const y = ((event.clientY - bounds.top) / bounds.height) * 100 - 50;
    const height = Math.max(0, 90 * (1 - Math.hypot(x, y) / 42));
    moved((Math.atan2(x, -y) * 180) / Math.PI, height);
  };
  return (
    <svg
      ref={pad}
      class="sunpad"
      viewBox="-50 -50 100 100"
      tabindex={0}
      role="application"
      aria-label={t.sunPad}
      onPointerDown={(event) => {
        pad.current!.setPointerCapture(event.pointerId);
        drag(event);
      }}
      onPointerMove={(event) => pad.current!.hasPointerCapture(event.pointerId) && drag(event)}
      onKeyDown={(event) => {
        const by = { ArrowLeft: [-3, 0], ArrowRight: [3, 0], ArrowUp: [0, 3], ArrowDown: [0, -3] }[event.key];
        if (!by) return;
        event.preventDefault();
        const turned = ((azimuth + by[0]! + 540) % 360) - 180;
        moved(turned, Math.min(Math.max(elevation + by[1]!, 0), 90));
      }}
    >
      <circle r="42" class="sky" />
      <circle r="21" class="mid" />
      <path d="M0 -42V42M-42 0H42" class="mid" />
      <path d="M-3 -44L0 -49L3 -44" class="ahead" />
      <circle class="sun" cx={far * Math.sin(angle)} cy={-far * Math.cos(angle)} r="6" />
    </svg>
  );
}
