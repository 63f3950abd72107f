// How bright the picture is: counts of its levels, and what is clipped.
import { useEffect, useState } from "preact/hooks";
import { address } from "./api";
import { useView } from "./store";
import { t } from "./strings";

const BINS = 64;
const SIDE = 320; // pixels of the copy that is counted

interface Counts {
  /** Of red, green and blue, each BINS long, relative to the fullest. */
  bins: number[][];
  dark: number;
  bright: number;
  mean: number;
}

export function counted(pixels: Uint8ClampedArray): Counts {
  const bins = [0, 1, 2].map(() => new Array<number>(BINS).fill(0));
  let [dark, bright, sum] = [0, 0, 0];
  const count = pixels.length / 4;
  for (let place = 0; place < pixels.length; place += 4) {
    const rgb = [pixels[place]!, pixels[place + 1]!, pixels[place + 2]!];
    rgb.forEach((level, channel) => bins[channel]![(level * BINS) >> 8]!++);
    if (Math.max(...rgb) <= 2) dark++;
    if (Math.max(...rgb) >= 254) bright++;
    sum += 0.2126 * rgb[0]! + 0.7152 * rgb[1]! + 0.0722 * rgb[2]!;
  }
  // The ends are often far above the rest; they must not flatten it.
  const most = Math.max(1, ...bins.flatMap((of) => of.slice(1, -1)));
  const relative = bins.map((of) => of.map((value) => Math.min(1, value / most)));
  return { bins: relative, dark: dark / count, bright: bright / count, mean: sum / count / 255 };
}

export function Histogram() {
  const { state } = useView();
  const [counts, setCounts] = useState<Counts | null>(null);
  const picture = state?.stage.picture || address("photo", { working: "1", project: state?.project?.name ?? "" });
  useEffect(() => {
    const image = new Image();
    image.onload = () => {
      const canvas = document.createElement("canvas");
      const scale = Math.min(1, SIDE / Math.max(image.naturalWidth, image.naturalHeight));
      canvas.width = Math.max(1, Math.round(image.naturalWidth * scale));
      canvas.height = Math.max(1, Math.round(image.naturalHeight * scale));
      const context = canvas.getContext("2d", { willReadFrequently: true })!;
      context.drawImage(image, 0, 0, canvas.width, canvas.height);
      setCounts(counted(context.getImageData(0, 0, canvas.width, canvas.height).data));
    };
    image.src = picture;
    return () => void (image.onload = null);
  }, [picture]);
  if (!counts) return null;
  const words = t.histogramWords(Math.round(counts.mean * 100), percent(counts.dark), percent(counts.bright));
  return (
    <>
      <svg class="histogram" id="histogram" viewBox={`0 0 ${BINS - 1} 32`} preserveAspectRatio="none" role="img" aria-label={words}>
        {counts.bins.map((bins, channel) => (
          <path key={channel} class={`channel-${channel}`} d={`M0 32${bins.map((value, x) => `L${x} ${32 - 31 * value}`).join("")}L${BINS - 1} 32Z`} />
        ))}
      </svg>
      <p class="soft">{words}</p>
    </>
  );
}

const percent = (share: number) => (share > 0 && share < 0.001 ? "< 0.1" : (share * 100).toFixed(1));
