// Where the photo lies in the window: fitted, zoomed about a point, moved.
import type { Box } from "./picture";

export interface Size {
  width: number;
  height: number;
}

export const MAX_ZOOM = 32;

/** The whole photo in the middle of the window. */
export function fitted(photo: Size, frame: Size): Box {
  if (!photo.width || !frame.width) return { left: 0, top: 0, width: 0, height: 0 };
  const scale = Math.min(frame.width / photo.width, frame.height / photo.height);
  const width = photo.width * scale;
  const height = photo.height * scale;
  return { left: (frame.width - width) / 2, top: (frame.height - height) / 2, width, height };
}

/** The photo larger or smaller by a factor about a place of the window, moved by (dx, dy). */
export function zoomed(box: Box, photo: Size, frame: Size, factor: number, x: number, y: number, dx = 0, dy = 0): Box {
  const least = fitted(photo, frame);
  const width = Math.min(Math.max(box.width * factor, least.width), least.width * MAX_ZOOM);
  const scale = width / box.width;
  const height = box.height * scale;
  // What is smaller than the window stays in its middle; what is larger covers it.
  const kept = (place: number, size: number, room: number) =>
    size <= room ? (room - size) / 2 : Math.min(Math.max(place, room - size), 0);
  return {
    left: kept(x + dx - (x - box.left) * scale, width, frame.width),
    top: kept(y + dy - (y - box.top) * scale, height, frame.height),
    width,
    height,
  };
}
