// A part of the state (clock, disk, journal, lease) as text: the service says a text, or an object with a word.

export function partText(part: unknown): string {
  if (part == null) return "";
  if (typeof part !== "object") return String(part);
  const fields = part as Record<string, unknown>;
  for (const key of ["text", "word", "holder", "name", "state"]) if (typeof fields[key] === "string") return fields[key];
  return Object.entries(fields).map(([key, value]) => `${key.replace(/_/g, " ")} ${value ?? "unknown"}`).join(", ");
}
