import { isRequired } from './section';

/** What a person who opened a container can do about it. */
export type ContainerErrorKind = 'not-a-container' | 'newer' | 'damaged' | 'changed';

/** Why a container cannot be read; the message is one or two sentences to show. */
export class ContainerError extends Error {
  override readonly name = 'ContainerError';

  constructor(
    readonly kind: ContainerErrorKind,
    message: string,
  ) {
    super(message);
  }
}

export function notAContainer(): ContainerError {
  const what = 'This is not a .cager file.';
  return new ContainerError('not-a-container', `${what} Choose one from cager encode or a session.`);
}

export function newerVersion(version: number): ContainerError {
  const what = `The file has version ${version} of the format, and this page reads version 1.`;
  return new ContainerError('newer', `${what} Use a newer viewer.`);
}

/** For a required section, a codec or a coordinate system of a later program. */
export function unknownFeature(feature: string): ContainerError {
  const name = feature.replace(/[^ -~]/g, '?').slice(0, 60);
  const what = `The file needs the feature “${name}”, which this viewer does not support.`;
  return new ContainerError('newer', `${what} Use a newer viewer.`);
}

/** @param what the part of a sentence that says what does not fit */
export function damaged(offset: number, what: string): ContainerError {
  return new ContainerError('damaged', `The file is damaged at byte ${offset}: ${what}. Download or copy it again.`);
}

export function checksumDamage(offset: number): ContainerError {
  return damaged(offset, 'the checksum of a section does not match');
}

export function changed(): ContainerError {
  return new ContainerError('changed', 'The capture changed on the server while it was read. Reload the page.');
}

/** Whether bytes were changed or are missing, so that others of the file may still be intact. */
export function isDamage(error: unknown): error is ContainerError {
  return error instanceof ContainerError && error.kind === 'damaged';
}

/** Whether the rest of a container can be used without a section that could not be read because of this. */
export function isTolerable(error: unknown, tag: string): boolean {
  return isDamage(error) || (error instanceof ContainerError && error.kind === 'newer' && !isRequired(tag));
}
