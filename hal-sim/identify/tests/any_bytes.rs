//! Whatever bytes a file has, it is read or refused with a sentence: no panic, no memory beyond a multiple of the file.
//! `FUZZ_EXECUTIONS` sets how many files of each kind are damaged in each way, `FUZZ_SEED` which.

mod asked;

use asked::asked;
use identify::records::{How, Mapping, OnFault, load};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::alloc::{GlobalAlloc, Layout, System};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Counts what is allocated, and the most of it at a time.
struct Counting;
static NOW: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);

// Safety: it is the system's allocator, which is only watched.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let now = NOW.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        MOST.fetch_max(now, Ordering::Relaxed);
        // Safety: as the caller promises.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Ordering::Relaxed);
        // Safety: as the caller promises.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Bytes that a reader may take for each byte of a small file, and beside that.
const TIMES: usize = 200;
const BESIDE: usize = 16 << 20;

/// Loads bytes under a name; whether it was a record.
fn tried(folder: &Path, name: &str, bytes: &[u8], mapping: &Mapping) -> bool {
    let path = folder.join(name);
    std::fs::write(&path, bytes).expect("a temporary file");
    let how = How {
        mapping,
        on_fault: OnFault::Skip,
        declared_hz: None,
    };
    let before = NOW.load(Ordering::Relaxed);
    MOST.store(before, Ordering::Relaxed);
    let loaded = load(&path, how, &mut |_| ());
    let most = MOST.load(Ordering::Relaxed) - before;
    assert!(
        most < TIMES * bytes.len() + BESIDE,
        "{name}: {} bytes took {most} bytes of memory, expected at most {TIMES} times as many and {BESIDE}",
        bytes.len()
    );
    if let Err(error) = &loaded {
        let sentence = error.to_string();
        assert!(
            sentence.len() > 20 && sentence.len() < 6000,
            "{name}: {sentence}"
        );
    }
    loaded.is_ok()
}

fn npy(rows: usize) -> Vec<u8> {
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': (3, {rows}), }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    for channel in 0..3 {
        bytes
            .extend((0..rows).flat_map(|k| (k as f64 * [1e-3, 0.01, 1e-4][channel]).to_le_bytes()));
    }
    bytes
}

fn npz(member: &[u8]) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default();
    zip.start_file("0.npy", options).expect("memory");
    std::io::Write::write_all(&mut zip, member).expect("memory");
    zip.finish().expect("memory").into_inner()
}

fn mat(rows: usize) -> Vec<u8> {
    let element = |kind: u32, data: &[u8]| {
        let mut bytes = [kind.to_le_bytes(), (data.len() as u32).to_le_bytes()].concat();
        bytes.extend(data);
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        bytes
    };
    let words = |words: [u32; 2]| words.map(u32::to_le_bytes).concat();
    let values: Vec<u8> = (0..rows)
        .flat_map(|k| [k as f64 * 1e-3, k as f64 * 0.01, k as f64 * 1e-4])
        .flat_map(f64::to_le_bytes)
        .collect();
    let vector = [
        element(6, &words([6, 0])),
        element(5, &words([3, rows as u32])),
        element(1, b""),
        element(9, &values),
    ]
    .concat();
    let structure = [
        element(6, &words([2, 0])),
        element(5, &words([1, 1])),
        element(1, b"data"),
        element(5, &8u32.to_le_bytes()),
        element(1, b"log\0\0\0\0\0"),
        element(14, &vector),
    ]
    .concat();
    let mut file = b"MATLAB 5.0 MAT-file".to_vec();
    file.resize(124, b' ');
    file.extend([0x00, 0x01, b'I', b'M']);
    file.extend(element(14, &structure));
    file
}

fn csv(rows: usize) -> Vec<u8> {
    let mut text = String::from("made by a logger\n\nt (s);\"angle; measured\";Iq (A)\n");
    for k in 0..rows {
        text += &format!(
            "{:.3};{:.2};{:.4}\n",
            k as f64 * 1e-3,
            k as f64 * 0.01,
            k as f64 * 1e-4
        );
    }
    text.into_bytes()
}

fn gz(bytes: &[u8]) -> Vec<u8> {
    let mut zip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut zip, bytes).expect("memory");
    zip.finish().expect("memory")
}

/// A file with some of its bytes, or what they say of lengths, changed; cut off; or with a piece of it twice.
fn damaged(random: &mut Xoshiro256PlusPlus, sound: &[u8]) -> Vec<u8> {
    let mut bytes = sound.to_vec();
    for _ in 0..random.random_range(1..6) {
        if bytes.is_empty() {
            break;
        }
        // Where lengths stand: at the start.
        let reach = if random.random::<bool>() {
            bytes.len()
        } else {
            bytes.len().min(400)
        };
        let at = random.random_range(0..reach);
        match random.random_range(0..6) {
            0 => bytes[at] = random.random(),
            1 => bytes[at] ^= 1 << random.random_range(0..8),
            2 => bytes.truncate(at),
            3 => {
                let huge = [0xff, 0xff, 0xff, 0x7f];
                for (byte, new) in bytes[at..].iter_mut().zip(huge) {
                    *byte = new;
                }
            }
            4 => {
                let piece: Vec<u8> = bytes[at..].iter().copied().take(200).collect();
                bytes.splice(at..at, piece);
            }
            _ => {
                let end = (at + random.random_range(0..50)).min(bytes.len());
                bytes.drain(at..end);
            }
        }
    }
    bytes
}

#[test]
fn no_bytes_panic_or_take_memory_without_bound() {
    let mapping = |paths: [&str; 3]| {
        let [t, angle, current] = paths.map(|path| format!("{{ name = \"{path}\" }}"));
        let text = format!(
            "machine = \"motor\"\n[columns]\nt_s = {t}\nposition_rad = {angle}\ncurrent_a = {current}\n"
        );
        Mapping::parse(&text, "mapping.toml").expect("a mapping")
    };
    let numbers = mapping(["0", "1", "2"]);
    let fields = mapping(["data.log.0", "data.log.1", "data.log.2"]);
    let rows = 2200;
    let csv = csv(rows);
    let sound = [
        ("a.npy", npy(rows), &numbers),
        ("a.npz", npz(&npy(rows)), &mapping(["0.0", "0.1", "0.2"])),
        ("a.mat", mat(rows), &fields),
        ("a.csv", csv.clone(), &numbers),
        ("a.csv.gz", gz(&csv), &numbers),
    ];
    let folder = tempfile::tempdir().expect("a temporary folder");
    let tries = asked("FUZZ_EXECUTIONS", 150);
    let seed = asked("FUZZ_SEED", 7);
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    for (name, bytes, mapping) in &sound {
        assert!(
            tried(folder.path(), name, bytes, mapping),
            "{name} is sound"
        );
        let read = (0..tries)
            .filter(|_| tried(folder.path(), name, &damaged(&mut random, bytes), mapping))
            .count();
        println!("{name}: {read} of {tries} damaged files are read all the same");
    }
    // A packed file that is sound, around one that is not: what is damaged behind a right check.
    let (npy, numbered) = (npy(rows), &mapping(["0.0", "0.1", "0.2"]));
    for (name, inner, pack, mapping) in [
        ("a.npz", &npy, npz as fn(&[u8]) -> Vec<u8>, numbered),
        ("a.csv.gz", &csv, gz, &numbers),
    ] {
        let read = (0..tries)
            .filter(|_| {
                tried(
                    folder.path(),
                    name,
                    &pack(&damaged(&mut random, inner)),
                    mapping,
                )
            })
            .count();
        println!("{name}: {read} of {tries} packed around damaged contents are read all the same");
        assert!(read > 0, "{name}: none of {tries} was read");
    }
    for name in ["a.npy", "a.npz", "a.mat", "a.csv", "a.csv.gz"] {
        for _ in 0..tries {
            let length = random.random_range(0..3000);
            let mut bytes: Vec<u8> = (0..length).map(|_| random.random()).collect();
            if random.random::<bool>() {
                // Text of the letters that rows have.
                let letters = b"0123456789.,;-+eE \t\n\r\"'#ab";
                bytes
                    .iter_mut()
                    .for_each(|b| *b = letters[usize::from(*b) % letters.len()]);
            }
            tried(folder.path(), name, &bytes, &numbers);
        }
    }
    // A text that unpacks to a thousand times its size is bounded by what it unpacks to, not refused.
    let bomb = gz(&vec![b'0'; 4 << 20]);
    assert!(!tried_unbounded(folder.path(), &bomb, &numbers));
}

/// As [`tried`], where the packed size says nothing of the memory.
fn tried_unbounded(folder: &Path, bytes: &[u8], mapping: &Mapping) -> bool {
    let path = folder.join("bomb.csv.gz");
    std::fs::write(&path, bytes).expect("a temporary file");
    let how = How {
        mapping,
        on_fault: OnFault::Skip,
        declared_hz: None,
    };
    load(&path, how, &mut |_| ()).is_ok()
}
