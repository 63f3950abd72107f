// Requests of this page. Every one names the page; the cookie names the person.

function pageName(): string {
  const known = sessionStorage.getItem("page");
  if (known) return known;
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  const name = [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("");
  sessionStorage.setItem("page", name);
  return name;
}

export const PAGE = pageName();
const HEADERS = { "x-materialist-page": PAGE };

export class Refusal extends Error {}

async function read<T>(answer: Response): Promise<T> {
  if (answer.status === 401) location.reload(); // the form for the password
  const body = await answer.json().catch(() => ({ error: `The studio answered ${answer.status}.` }));
  if (!answer.ok) throw new Refusal(body.error ?? `The studio answered ${answer.status}.`);
  return body as T;
}

export async function get<T>(place: string): Promise<T> {
  return read<T>(await fetch(`/api/${place}`, { headers: HEADERS }));
}

export async function post<T>(place: string, body: object = {}): Promise<T> {
  const headers = { ...HEADERS, "content-type": "application/json" };
  const text = JSON.stringify(body);
  // What is small arrives also when the page is closed meanwhile.
  return read<T>(await fetch(`/api/${place}`, { method: "POST", headers, body: text, keepalive: text.length < 30_000 }));
}

/** What is not text. */
export async function bytes(place: string): Promise<ArrayBuffer> {
  const answer = await fetch(`/api/${place}`, { headers: HEADERS });
  return answer.ok ? answer.arrayBuffer() : read(answer);
}

/** An answer as an object; a proxy between may answer with a page of its own. */
function parsed(text: string): { file?: string; error?: string } {
  try {
    return JSON.parse(text || "{}");
  } catch {
    return {};
  }
}

/** Send a file; returns the id by which requests may name it. */
export function upload(file: File, progress: (part: number) => void): Promise<string> {
  return new Promise((done, failed) => {
    // fetch tells nothing of how much was sent.
    const request = new XMLHttpRequest();
    request.open("POST", `/api/upload?name=${encodeURIComponent(file.name)}`);
    request.setRequestHeader("x-materialist-page", PAGE);
    request.upload.onprogress = (event) => progress(event.loaded / Math.max(event.total, 1));
    request.onerror = () => failed(new Refusal("The file could not be sent."));
    request.onload = () => {
      const body = parsed(request.responseText);
      if (request.status === 200) done(body.file as string);
      else failed(new Refusal(body.error ?? "The file was refused."));
    };
    request.send(file);
  });
}

/** The address of a picture. */
export function address(place: string, query: Record<string, string> = {}): string {
  return `/api/${place}?${new URLSearchParams({ page: PAGE, ...query })}`;
}
