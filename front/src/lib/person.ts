// Names of persons, as the site takes them for a lease and for an acknowledgement.

export const PERSON = "[A-Za-z][A-Za-z0-9_\\-]{0,15}";
export const PERSON_TEXT = "A letter, then letters, digits, - and _; 16 at most";

const WHOLE = new RegExp(`^${PERSON}$`);

export function isPerson(text: string): boolean {
  return WHOLE.test(text.trim());
}
