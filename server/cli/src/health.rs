//! `tyndall health`.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use anyhow::{Context, bail};

/// Longest wait for the connection, and for each piece of the answer.
const PATIENCE: Duration = Duration::from_secs(4);
/// Longest answer that is read, bytes.
const MAX_ANSWER: u64 = 4096;

#[derive(clap::Args)]
pub struct Arguments {
    /// Address of the service.
    #[arg(value_name = "ADDR", default_value = "127.0.0.1:8080")]
    address: SocketAddr,
}

/// Asks a running service whether it can do its work.
///
/// # Errors
/// It cannot, or does not answer.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let Arguments { address } = arguments;
    let mut stream = TcpStream::connect_timeout(address, PATIENCE)
        .with_context(|| format!("nothing answers at {address}"))?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    write!(stream, "GET /readyz HTTP/1.0\r\nHost: {address}\r\n\r\n")?;
    let mut answer = String::new();
    stream.take(MAX_ANSWER).read_to_string(&mut answer).context("the answer broke off")?;
    let (head, body) = answer.split_once("\r\n\r\n").unwrap_or((&answer, ""));
    let status = head.split_whitespace().nth(1).unwrap_or("no status");
    if status != "200" {
        bail!("the service is not ready ({status}): {}", body.trim());
    }
    println!("{}", body.trim());
    Ok(())
}
