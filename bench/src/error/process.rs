//! What this process has used, where the system tells (Linux).

/// Processor seconds of all threads so far: user and system time, in hundredths.
pub fn cpu_seconds() -> Option<f64> {
    crate::farm::cpu_seconds(std::process::id())
}

/// Starts the count of the peak anew.
pub fn reset_peak() {
    // Where it can't be reset, the peak is that since the start.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// Largest resident memory since the count began, in MiB.
pub fn peak_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    Some(line.trim().trim_end_matches("kB").trim().parse::<f64>().ok()? / 1024.0)
}
