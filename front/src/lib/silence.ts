// Who is silent: the service that gives the page its data, or the coordinator behind it.

export const SILENCE_S = 1.65; // with the tick of the live link: greyed within 2 s of the last word

const JOURNAL_S = 10; // of a journal, whose state does not grow old and may take long to read

export interface Heard {
  lost: boolean; // the socket is closed
  service: number; // s since the last "state", or since the start before the first
  coordinator: number; // s since the coordinator's last word, as far as the page knows
  connected: boolean | null; // as the service says of the coordinator; null: nothing said yet
  watched: boolean; // a coordinator is watched: not where the state comes from a journal
}

/** The silent part, nearest to the page first; null where all speak. */
export function silentPart(heard: Heard): "service" | "coordinator" | null {
  const journal = heard.connected !== null && !heard.watched;
  if (heard.lost || heard.service > (journal ? JOURNAL_S : SILENCE_S)) return "service";
  if (heard.connected === null || journal) return null;
  return !heard.connected || heard.coordinator > SILENCE_S ? "coordinator" : null;
}
