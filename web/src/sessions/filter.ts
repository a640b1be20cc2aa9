import type { Session } from '../service/messages';

/** States as people ask for them: `running` is everything that is not over. */
export type StateFilter = 'all' | 'running' | 'completed' | 'failed';

export interface Filter {
  readonly text: string;
  readonly state: StateFilter;
}

/** Whether a session is one of those asked for: every word is in its name, its identifier, its state or its coordinates. */
export function matches(session: Session, filter: Filter): boolean {
  const isOver = session.state === 'completed' || session.state === 'failed';
  if (filter.state === 'running' ? isOver : filter.state !== 'all' && session.state !== filter.state) return false;
  const text = [session.name ?? '', session.id, session.state, session.coordinates].join(' ').toLowerCase();
  return filter.text
    .toLowerCase()
    .split(/\s+/)
    .every((word) => text.includes(word));
}

/** Whether anything is left out. */
export function isFiltering(filter: Filter): boolean {
  return filter.state !== 'all' || filter.text.trim() !== '';
}
