//! Host names without the C library: `/etc/hosts`, then UDP queries to the name servers of `/etc/resolv.conf` (RFC 1035).
//!
//! A static binary in an empty container image has no name service modules to load, so `getaddrinfo` can't be relied on there.

use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use tokio::net::UdpSocket;
use tokio::time::timeout;

const TYPE_A: u16 = 1;
const TYPE_AAAA: u16 = 28;
const CLASS_IN: u16 = 1;
/// How long a name server may take; each is asked twice.
const PATIENCE: Duration = Duration::from_millis(1500);
/// The largest file that is read as configuration.
const MAX_CONFIG: usize = 1 << 20;

/// Where names are looked up.
#[derive(Clone, Debug)]
pub struct Resolver {
    hosts: PathBuf,
    conf: PathBuf,
    port: u16,
}

impl Default for Resolver {
    fn default() -> Self {
        Self { hosts: "/etc/hosts".into(), conf: "/etc/resolv.conf".into(), port: 53 }
    }
}

/// What `resolv.conf` says.
#[derive(Debug, PartialEq)]
struct Conf {
    servers: Vec<IpAddr>,
    search: Vec<String>,
    ndots: usize,
}

/// The addresses of `host:port`: a number, the system's answer, or (always in a static binary) our own look-up.
pub async fn resolve(host: &str, port: u16) -> io::Result<Vec<SocketAddr>> {
    let bare = host.trim_start_matches('[').trim_end_matches(']');
    if let Ok(ip) = bare.parse::<IpAddr>() {
        return Ok(vec![SocketAddr::new(ip, port)]);
    }
    if !cfg!(target_feature = "crt-static")
        && let Ok(found) = tokio::net::lookup_host((bare, port)).await
    {
        let found: Vec<SocketAddr> = found.collect();
        if !found.is_empty() {
            return Ok(found);
        }
    }
    let ips = Resolver::default().lookup(bare).await?;
    Ok(ips.into_iter().map(|ip| SocketAddr::new(ip, port)).collect())
}

impl Resolver {
    /// The addresses of a host name.
    pub async fn lookup(&self, host: &str) -> io::Result<Vec<IpAddr>> {
        let found = hosts_entries(&read_config(&self.hosts), host);
        if !found.is_empty() {
            return Ok(found);
        }
        if host.eq_ignore_ascii_case("localhost") {
            return Ok(vec![Ipv4Addr::LOCALHOST.into()]);
        }
        let conf = parse_conf(&read_config(&self.conf));
        let mut last = None;
        for name in candidates(host, &conf) {
            for kind in [TYPE_A, TYPE_AAAA] {
                match self.ask(&conf.servers, &name, kind).await {
                    Ok(found) if !found.is_empty() => return Ok(found),
                    Ok(_) => {}
                    Err(e) => last = Some(e),
                }
            }
        }
        Err(last.unwrap_or_else(|| io::Error::new(io::ErrorKind::NotFound, format!("no host is called {host:?}"))))
    }

    async fn ask(&self, servers: &[IpAddr], name: &str, kind: u16) -> io::Result<Vec<IpAddr>> {
        let mut last = io::Error::new(io::ErrorKind::NotFound, "no name server is configured");
        for server in servers.iter().chain(servers) {
            match timeout(PATIENCE, query(SocketAddr::new(*server, self.port), name, kind)).await {
                Ok(Ok(found)) => return Ok(found),
                Ok(Err(e)) => last = e,
                Err(_) => {
                    last = io::Error::new(io::ErrorKind::TimedOut, format!("name server {server} does not answer"));
                }
            }
        }
        Err(last)
    }
}

/// A file's text; empty when it can't be read.
fn read_config(path: &Path) -> String {
    let mut bytes = std::fs::read(path).unwrap_or_default();
    bytes.truncate(MAX_CONFIG);
    String::from_utf8_lossy(&bytes).into_owned()
}

/// The words of each line, without comments.
fn lines(text: &str) -> impl Iterator<Item = Vec<&str>> {
    text.lines().map(|l| l.split(['#', ';']).next().unwrap_or("").split_whitespace().collect())
}

fn hosts_entries(text: &str, host: &str) -> Vec<IpAddr> {
    lines(text)
        .filter(|words| words.iter().skip(1).any(|w| w.eq_ignore_ascii_case(host)))
        .filter_map(|words| words.first()?.parse().ok())
        .collect()
}

fn parse_conf(text: &str) -> Conf {
    let mut conf = Conf { servers: Vec::new(), search: Vec::new(), ndots: 1 };
    for words in lines(text) {
        match words.as_slice() {
            // A scope (`fe80::1%eth0`) is left out: link-local name servers need an interface number.
            ["nameserver", ip, ..] => conf.servers.extend(ip.parse::<IpAddr>()),
            ["search" | "domain", list @ ..] => conf.search = list.iter().map(|s| s.to_string()).collect(),
            ["options", list @ ..] => {
                let ndots = list.iter().find_map(|o| o.strip_prefix("ndots:")?.parse().ok());
                conf.ndots = ndots.unwrap_or(conf.ndots);
            }
            _ => {}
        }
    }
    conf.servers.truncate(3);
    conf.search.truncate(6);
    conf
}

/// The full names to try, in order (resolv.conf(5), `search` and `ndots`).
fn candidates(host: &str, conf: &Conf) -> Vec<String> {
    if let Some(absolute) = host.strip_suffix('.') {
        return vec![absolute.to_string()];
    }
    let searched = conf.search.iter().map(|s| format!("{host}.{}", s.trim_matches('.')));
    let own = std::iter::once(host.to_string());
    if host.matches('.').count() >= conf.ndots { own.chain(searched).collect() } else { searched.chain(own).collect() }
}

async fn query(server: SocketAddr, name: &str, kind: u16) -> io::Result<Vec<IpAddr>> {
    let any: IpAddr = if server.is_ipv4() { Ipv4Addr::UNSPECIFIED.into() } else { Ipv6Addr::UNSPECIFIED.into() };
    let socket = UdpSocket::bind(SocketAddr::new(any, 0)).await?;
    // Connected: answers of others never arrive.
    socket.connect(server).await?;
    let id = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.subsec_nanos()) as u16;
    let question = encode_query(id, name, kind)
        .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, format!("{name:?} is not a host name")))?;
    socket.send(&question).await?;
    let mut buffer = [0; 4096];
    loop {
        let len = socket.recv(&mut buffer).await?;
        if let Some(answer) = decode_answer(&buffer[..len], id, kind) {
            return answer
                .map_err(|code| io::Error::other(format!("the name server refuses {name:?} (response code {code})")));
        }
    }
}

/// A query with recursion desired; `None` when the name can't be written in DNS.
fn encode_query(id: u16, name: &str, kind: u16) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(name.len() + 18);
    for v in [id, 0x0100, 1, 0, 0, 0] {
        out.extend(v.to_be_bytes());
    }
    for label in name.split('.') {
        if label.is_empty() || label.len() > 63 || !label.bytes().all(|b| b.is_ascii_graphic()) {
            return None;
        }
        out.push(label.len() as u8);
        out.extend(label.as_bytes());
    }
    out.push(0);
    for v in [kind, CLASS_IN] {
        out.extend(v.to_be_bytes());
    }
    (name.len() <= 253).then_some(out)
}

/// The addresses in an answer to query `id`. `None`: not an answer to it. A name that does not exist has no addresses; other
/// refusals give their response code.
fn decode_answer(packet: &[u8], id: u16, kind: u16) -> Option<Result<Vec<IpAddr>, u8>> {
    let word = |at: usize| Some(u16::from_be_bytes(packet.get(at..at + 2)?.try_into().ok()?));
    if word(0)? != id || word(2)? & 0x8000 == 0 {
        return None;
    }
    let code = (word(2)? & 0xf) as u8;
    if code != 0 {
        const NAME_ERROR: u8 = 3;
        return Some(if code == NAME_ERROR { Ok(Vec::new()) } else { Err(code) });
    }
    let mut at = 12;
    for _ in 0..word(4)? {
        at = skip_name(packet, at)? + 4;
    }
    let mut found = Vec::new();
    for _ in 0..word(6)? {
        at = skip_name(packet, at)?;
        let (record, len) = (word(at)?, usize::from(word(at + 8)?));
        let data = packet.get(at + 10..at + 10 + len)?;
        if record == kind {
            if let Ok(v4) = <[u8; 4]>::try_from(data) {
                found.push(Ipv4Addr::from(v4).into());
            } else if let Ok(v6) = <[u8; 16]>::try_from(data) {
                found.push(Ipv6Addr::from(v6).into());
            }
        }
        at += 10 + len;
    }
    Some(Ok(found))
}

/// The position after a name: labels up to a zero byte, or up to a pointer, which ends it.
fn skip_name(packet: &[u8], mut at: usize) -> Option<usize> {
    loop {
        match *packet.get(at)? {
            0 => return Some(at + 1),
            n if n & 0xc0 == 0xc0 => return Some(at + 2),
            n => at += 1 + usize::from(n),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(query: &[u8], records: &[(u16, &[u8])]) -> Vec<u8> {
        let mut out = query[..2].to_vec();
        for v in [0x8180u16, 1, records.len() as u16, 0, 0] {
            out.extend(v.to_be_bytes());
        }
        out.extend(&query[12..]);
        for (kind, data) in records {
            out.extend([0xc0, 12]);
            for v in [*kind, CLASS_IN, 0, 60, data.len() as u16] {
                out.extend(v.to_be_bytes());
            }
            out.extend(*data);
        }
        out
    }

    #[test]
    fn reads_hosts_and_resolv_conf() {
        let hosts =
            "127.0.0.1 localhost # me\n10.0.0.7\tcoordinator coordinator.farm\n# 10.0.0.8 hidden\n::1 localhost\n";
        assert_eq!(hosts_entries(hosts, "Coordinator"), ["10.0.0.7".parse::<IpAddr>().unwrap()]);
        assert_eq!(hosts_entries(hosts, "localhost").len(), 2);
        assert!(hosts_entries(hosts, "hidden").is_empty());
        let conf = parse_conf("; x\nsearch a.b c\nnameserver 127.0.0.11\nnameserver nonsense\noptions edns0 ndots:2\n");
        assert_eq!(
            conf,
            Conf { servers: vec!["127.0.0.11".parse().unwrap()], search: vec!["a.b".into(), "c".into()], ndots: 2 }
        );
        assert_eq!(candidates("coordinator", &conf), ["coordinator.a.b", "coordinator.c", "coordinator"]);
        assert_eq!(candidates("x.y.z", &conf)[0], "x.y.z");
        assert_eq!(candidates("x.", &conf), ["x"]);
    }

    #[test]
    fn refuses_what_is_no_name_and_survives_any_packet() {
        assert!(encode_query(1, "a..b", TYPE_A).is_none());
        assert!(encode_query(1, &"x".repeat(64), TYPE_A).is_none());
        assert!(encode_query(1, &"x.".repeat(200), TYPE_A).is_none());
        let query = encode_query(7, "coordinator", TYPE_A).unwrap();
        let full = answer(&query, &[(5, b"\x01x\x00"), (TYPE_A, &[10, 0, 0, 7])]);
        assert_eq!(decode_answer(&full, 7, TYPE_A), Some(Ok(vec!["10.0.0.7".parse().unwrap()])));
        assert_eq!(decode_answer(&full, 8, TYPE_A), None);
        for cut in 0..full.len() {
            assert!(matches!(decode_answer(&full[..cut], 7, TYPE_A), None | Some(Ok(_))));
            for byte in [0, 1, 0x3f, 0xc0, 0xff] {
                let mut damaged = full.clone();
                damaged[cut] = byte;
                let _ = decode_answer(&damaged, 7, TYPE_A);
            }
        }
    }

    #[tokio::test]
    async fn asks_the_name_server_of_resolv_conf() {
        let server = UdpSocket::bind("127.0.0.1:0").await.unwrap();
        let port = server.local_addr().unwrap().port();
        let folder = std::env::temp_dir().join(format!("lightfarm-dns-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let (hosts, conf) = (folder.join("hosts"), folder.join("resolv.conf"));
        std::fs::write(&hosts, "10.1.1.1 known\n").unwrap();
        std::fs::write(&conf, "nameserver 127.0.0.1\nsearch farm.test\n").unwrap();
        let task = tokio::spawn(async move {
            let mut names = Vec::new();
            let mut buffer = [0; 512];
            for _ in 0..3 {
                let (len, peer) = server.recv_from(&mut buffer).await.unwrap();
                let question = buffer[..len].to_vec();
                names.push(String::from_utf8_lossy(&question[13..len - 5]).into_owned());
                let searched = question.windows(4).any(|w| w == b"farm");
                let reply =
                    if searched { answer(&question, &[]) } else { answer(&question, &[(TYPE_A, &[10, 9, 8, 7])]) };
                server.send_to(&reply, peer).await.unwrap();
            }
            names
        });
        let resolver = Resolver { hosts, conf, port };
        assert_eq!(resolver.lookup("known").await.unwrap(), ["10.1.1.1".parse::<IpAddr>().unwrap()]);
        assert_eq!(resolver.lookup("coordinator").await.unwrap(), ["10.9.8.7".parse::<IpAddr>().unwrap()]);
        let names = task.await.unwrap();
        assert_eq!(names.len(), 3, "the searched name by A and AAAA, then the plain one: {names:?}");
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[tokio::test]
    async fn numbers_need_no_look_up() {
        assert_eq!(resolve("[::1]", 5).await.unwrap(), ["[::1]:5".parse::<SocketAddr>().unwrap()]);
        assert_eq!(resolve("127.0.0.1", 5).await.unwrap(), ["127.0.0.1:5".parse::<SocketAddr>().unwrap()]);
        assert!(!resolve("localhost", 5).await.unwrap().is_empty());
    }
}
