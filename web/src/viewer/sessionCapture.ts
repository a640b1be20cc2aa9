import type { Capture } from '../capture';
import { openSession, type OpenSessionOptions } from '../service/live';
import { type Service, sessionPath } from '../service/service';

/** Opens a session, with what the service does for it: coordinates, handles, its container and decoding. */
export async function sessionCapture(
  id: string,
  options: OpenSessionOptions & { readonly service: Service },
): Promise<Capture> {
  const { service } = options;
  const capture: Capture = await openSession(id, options);
  const below = (path: string) => sessionPath(id, path);
  capture.coordinates = async (onProgress, until) => (await service.coordinates(id, onProgress, until)).values;
  capture.container ??= (until) => service.source(below('capture.cager'), until);
  capture.decode = (cages, until) => {
    const headers = { 'Content-Type': 'application/octet-stream' };
    return service.request(below('decode'), { method: 'POST', headers, body: cages, signal: until ?? null });
  };
  capture.handles = (until) => service.handles(id, until);
  capture.session = id;
  capture.identity = `session ${service.address(sessionPath(id))}`;
  return capture;
}
