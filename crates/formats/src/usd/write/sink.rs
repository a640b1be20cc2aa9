//! Bytes of a layer one after another, alone or as the only file of a package.

use std::io::{self, Seek, SeekFrom, Write};

use flate2::Crc;

/// Bytes before the values, which are written last.
const HEAD: usize = 88;
/// Where files of a package begin is a multiple of this.
const ALIGNED: usize = 64;
/// Bytes of the header before a file in a package, with its name.
const LOCAL: usize = 30;

pub(super) struct Sink<W> {
    out: W,
    at: u64,
    package: Option<Package>,
}

/// A zip archive of one file that is stored as it is.
struct Package {
    name: String,
    before: usize,
    /// Of all but the head.
    crc: Crc,
}

impl<W: Write + Seek> Sink<W> {
    /// Begins a layer, or a package of a layer that is called `packed`.
    pub(super) fn new(mut out: W, packed: Option<String>) -> io::Result<Self> {
        let package = packed.map(|name| {
            // Filled up by a field of its own, whose header has four bytes.
            let before = (LOCAL + name.len() + 4).next_multiple_of(ALIGNED);
            Package { name, before, crc: Crc::new() }
        });
        out.write_all(&vec![0; package.as_ref().map_or(0, |package| package.before)])?;
        out.write_all(&[0; HEAD])?;
        Ok(Self { out, at: HEAD as u64, package })
    }

    /// Writes bytes; gives where they are.
    pub(super) fn put(&mut self, bytes: &[u8]) -> io::Result<u64> {
        let at = self.at;
        self.out.write_all(bytes)?;
        if let Some(package) = &mut self.package {
            package.crc.update(bytes);
        }
        self.at += bytes.len() as u64;
        Ok(at)
    }

    /// Fills up to where a value may begin.
    pub(super) fn align(&mut self) -> io::Result<()> {
        let missing = self.at.next_multiple_of(8) - self.at;
        self.put(&[0; 8][..missing as usize])?;
        Ok(())
    }

    /// Ends the layer with what it begins with, and the package around it.
    pub(super) fn close(mut self, head: &[u8]) -> io::Result<W> {
        let mut first = [0; HEAD];
        first[..head.len()].copy_from_slice(head);
        let before = self.package.as_ref().map_or(0, |package| package.before);
        if let Some(package) = &self.package {
            let mut crc = Crc::new();
            crc.update(&first);
            crc.combine(&package.crc);
            let [local, central] = package.headers(crc.sum(), self.at as u32);
            self.out.write_all(&central)?;
            self.out.rewind()?;
            self.out.write_all(&local)?;
        }
        self.out.seek(SeekFrom::Start(before as u64))?;
        self.out.write_all(&first)?;
        self.out.seek(SeekFrom::End(0))?;
        Ok(self.out)
    }
}

impl Package {
    /// What stands before the file, and behind it.
    fn headers(&self, crc: u32, length: u32) -> [Vec<u8>; 2] {
        let filled = self.before - LOCAL - self.name.len();
        let [crc, length] = [crc, length].map(u32::to_le_bytes);
        // Version, no flags, stored, 1 January 1980; then the sizes, and the length of the name.
        let mut common = vec![10, 0, 0, 0, 0, 0, 0, 0, 0x21, 0];
        [crc, length, length].iter().for_each(|number| common.extend(number));
        common.extend((self.name.len() as u16).to_le_bytes());
        let (name, filling) = (self.name.as_bytes(), (filled as u16).to_le_bytes());
        let own = [[0x86, 0x19], (filled as u16 - 4).to_le_bytes()].concat();
        let local = [b"PK\x03\x04", &common[..], &filling, name, &own, &vec![0; filled - 4]].concat();
        let mut central = [b"PK\x01\x02\x0a\0", &common[..], &[0; 16], name].concat();
        let (size, at) = (central.len() as u32, self.before as u32 + u32::from_le_bytes(length));
        central.extend(b"PK\x05\x06\0\0\0\0\x01\0\x01\0");
        central.extend([size.to_le_bytes(), at.to_le_bytes()].concat());
        central.extend([0, 0]);
        [local, central]
    }
}
