/** Pictures of materials as textures. */

import { LinearMipmapLinearFilter, NoColorSpace, RepeatWrapping, SRGBColorSpace, Texture } from 'three';
import type { Material, TextureChannel } from '../capture';
import { TILES } from '../container/surface';
import type { MaterialTexture } from './materialView';
import { isSoftwareRendered } from './webgl';

/** Most pixels along a side, and most of all pictures together; larger ones are made smaller. */
const [MAX_SIDE, MAX_PIXELS] = [4096, 1 << 26];

export class MaterialPictures {
  private readonly textures = new Map<string, MaterialTexture>();
  private isDisposed = false;

  /**
   * Takes files by their paths, as far as materials name them.
   *
   * @returns paths of those that no browser shows
   */
  async load(
    files: ReadonlyMap<string, Uint8Array<ArrayBuffer>>,
    materials: readonly Material[],
    limit: number,
  ): Promise<string[]> {
    const wanted = new Map<string, { path: string; isColor: boolean }>();
    for (const path of files.keys()) {
      for (const material of materials) {
        for (const { channel, path: named } of material.textures) {
          const isColor = isReadAsLight(material, channel);
          if (isNamed(path, named)) wanted.set(keyOf(path, isColor), { path, isColor });
        }
      }
    }
    const side = Math.min(limit, MAX_SIDE, Math.floor(Math.sqrt(MAX_PIXELS / Math.max(1, wanted.size))));
    const refused = new Set<string>();
    for (const [key, { path, isColor }] of wanted) {
      const bytes = files.get(path)!;
      try {
        const texture = textureOf(await bitmapOf(bytes, side), isColor);
        if (this.isDisposed) return [];
        this.textures.set(key, { texture, hasAlpha: hasAlpha(bytes) });
      } catch {
        refused.add(path);
      }
    }
    return [...refused];
  }

  /** The picture of a channel, where it is there. */
  of(material: Material, channel: TextureChannel, tile: number): MaterialTexture | null {
    const path = pathOf(material, channel)?.replace(TILES, String(tile));
    return path === undefined ? null : (this.textures.get(keyOf(path, isReadAsLight(material, channel))) ?? null);
  }

  dispose() {
    this.isDisposed = true;
    for (const { texture } of this.textures.values()) {
      (texture.image as ImageBitmap).close();
      texture.dispose();
    }
  }
}

/** Whether a path is what a material names, or one tile of it. */
function isNamed(path: string, named: string): boolean {
  const at = named.indexOf(TILES);
  if (at < 0) return path === named;
  const [before, after] = [named.slice(0, at), named.slice(at + TILES.length)];
  return path.startsWith(before) && path.endsWith(after) && path.length === before.length + 4 + after.length;
}

function pathOf({ textures }: Material, channel: TextureChannel): string | undefined {
  return textures.find((texture) => texture.channel === channel)?.path;
}

/** Colours are read as light, other numbers as they are; the alpha channel of a colour goes with it. */
function isReadAsLight(material: Material, channel: TextureChannel): boolean {
  const isAlpha = channel === 'opacity' && pathOf(material, channel) === pathOf(material, 'base_color');
  return channel === 'base_color' || isAlpha;
}

function keyOf(path: string, isColor: boolean): string {
  return `${isColor ? 'color' : 'data'} ${path}`;
}

async function bitmapOf(bytes: Uint8Array<ArrayBuffer>, side: number): Promise<ImageBitmap> {
  const options = { premultiplyAlpha: 'none', colorSpaceConversion: 'none' } as const;
  const bitmap = await createImageBitmap(new Blob([bytes]), options);
  const scale = side / Math.max(bitmap.width, bitmap.height);
  if (scale >= 1) return bitmap;
  const [resizeWidth, resizeHeight] = [bitmap.width, bitmap.height].map((size) =>
    Math.max(1, Math.round(scale * size)),
  );
  const smaller = await createImageBitmap(bitmap, { ...options, resizeWidth, resizeHeight, resizeQuality: 'high' });
  bitmap.close();
  return smaller;
}

function textureOf(bitmap: ImageBitmap, isColor: boolean): Texture {
  const texture = new Texture(bitmap);
  texture.colorSpace = isColor ? SRGBColorSpace : NoColorSpace;
  texture.wrapS = texture.wrapT = RepeatWrapping;
  texture.minFilter = LinearMipmapLinearFilter;
  texture.anisotropy = isSoftwareRendered() ? 1 : 4;
  texture.flipY = false;
  texture.needsUpdate = true;
  return texture;
}

/** Whether the file of a picture says that it has an alpha channel: a PNG by its kind of colour, a WebP by its flags; no JPEG has one. */
export function hasAlpha(bytes: Uint8Array): boolean {
  const text = (at: number) => String.fromCharCode(...bytes.subarray(at, at + 4));
  if (text(0) === '\x89PNG') return bytes[25] === 4 || bytes[25] === 6;
  if (text(8) !== 'WEBP') return false;
  return text(12) === 'VP8X' ? (bytes[20] & 0x10) !== 0 : text(12) === 'VP8L' && (bytes[24] & 0x10) !== 0;
}
