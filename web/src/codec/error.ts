/** Bytes that no encoder wrote: they were cut, damaged, or belong to another model. All decoders throw it. The message is part of a sentence, without a full stop. */
export class CodedDataError extends Error {
  override readonly name = 'CodedDataError';
}
