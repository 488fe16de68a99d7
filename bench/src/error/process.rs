//! What this process has used, where the system tells (Linux).

/// Processor seconds of all threads so far: user and system time, in hundredths.
pub fn cpu_seconds() -> Option<f64> {
    crate::farm::cpu_seconds(std::process::id())
}

/// Processor seconds of all children that have ended and were waited for (fields 16 and 17 of the stat file, in hundredths).
pub fn children_cpu_seconds() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    let fields: Vec<&str> = stat.rsplit(')').next()?.split_whitespace().collect();
    let ticks: f64 = fields.get(13)?.parse::<f64>().ok()? + fields.get(14)?.parse::<f64>().ok()?;
    Some(ticks / 100.0)
}

/// Starts the count of the peak anew.
pub fn reset_peak() {
    // Where it can't be reset, the peak is that since the start.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// Largest resident memory since the count began, in MiB.
pub fn peak_mib() -> Option<f64> {
    peak_mib_of(std::process::id())
}

/// Largest resident memory of a process so far, in MiB.
pub fn peak_mib_of(pid: u32) -> Option<f64> {
    status_mib(pid, "VmHWM:")
}

/// Resident memory, in MiB.
pub fn resident_mib() -> Option<f64> {
    status_mib(std::process::id(), "VmRSS:")
}

fn status_mib(pid: u32, key: &str) -> Option<f64> {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix(key))?;
    Some(line.trim().trim_end_matches("kB").trim().parse::<f64>().ok()? / 1024.0)
}
