// JSON over HTTP to the service that gave this page.
import { token } from "./token.svelte";

/** A refusal of the service, in its own words; status 0: the service did not answer. */
export class ApiError extends Error {
  readonly status: number;
  constructor(status: number, message: string) {
    super(message);
    this.name = "ApiError";
    this.status = status;
  }
}

export type Query = Record<string, string | number | boolean | null | undefined>;

export function address(path: string, query: Query = {}): string {
  const parts = new URLSearchParams();
  for (const [key, value] of Object.entries(query)) if (value != null && value !== "") parts.set(key, String(value));
  const text = parts.toString();
  return text ? `${path}?${text}` : path;
}

/** GET of a path such as "/api/epochs/12"; names in a path are the caller's to encode (encodeURIComponent). */
export function get<T>(path: string, query: Query = {}, signal?: AbortSignal): Promise<T> {
  return call<T>(address(path, query), { method: "GET", signal: signal ?? null });
}

export function post<T>(path: string, body: unknown): Promise<T> {
  return call<T>(path, { method: "POST", body: JSON.stringify(body) }, { "Content-Type": "application/json" });
}

async function call<T>(path: string, init: RequestInit, headers: Record<string, string> = {}): Promise<T> {
  const known: Record<string, string> = token.text ? { Authorization: `Bearer ${token.text}` } : {};
  let answer: Response;
  try {
    answer = await fetch(path, { ...init, headers: { ...headers, ...known }, cache: "no-store", redirect: "error" });
  } catch (error) {
    if (error instanceof DOMException && error.name === "AbortError") throw error;
    throw new ApiError(0, "the service does not answer");
  }
  const text = await answer.text();
  let body: unknown = null;
  try {
    body = text ? JSON.parse(text) : null;
  } catch {
    throw new ApiError(answer.status, `status ${answer.status}, and no JSON in the answer`);
  }
  if (!answer.ok) throw new ApiError(answer.status, refusal(body) ?? `status ${answer.status}`);
  return body as T;
}

function refusal(body: unknown): string | null {
  const text = body && typeof body === "object" ? (body as Record<string, unknown>).error : null;
  return typeof text === "string" ? text : null;
}
