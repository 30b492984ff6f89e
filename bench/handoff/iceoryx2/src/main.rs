// SPDX-License-Identifier: Apache-2.0
//! Measures the one-way latency of a 128-byte message to another process, and of the response on its way back. Both
//! are sent as iceoryx2 samples. The receiver either sleeps until an iceoryx2 event arrives, or polls. The rounds and
//! statistics are those of bench_handoff.cpp.
use iceoryx2::port::{
    listener::Listener, notifier::Notifier, publisher::Publisher, subscriber::Subscriber,
};
use iceoryx2::prelude::*;
use std::error::Error;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// About the size of arhost's results.
#[repr(C)]
#[derive(Debug, Clone, Copy, ZeroCopySend)]
struct Message {
    sent_ns: i64,
    forward_ns: i64,
    padding: [u64; 14],
}

fn now_ns() -> i64 {
    let mut time = libc::timespec {
        tv_sec: 0,
        tv_nsec: 0,
    };
    // SAFETY: `time` is valid for writing.
    unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &mut time) };
    time.tv_sec * 1_000_000_000 + time.tv_nsec
}

/// Sending end of one direction: messages, and the event that wakes the receiver.
struct Sender {
    publisher: Publisher<ipc::Service, Message, ()>,
    notifier: Notifier<ipc::Service>,
}

/// Receiving end of one direction.
struct Receiver {
    subscriber: Subscriber<ipc::Service, Message, ()>,
    listener: Listener<ipc::Service>,
}

type Messages =
    iceoryx2::service::port_factory::publish_subscribe::PortFactory<ipc::Service, Message, ()>;
type Events = iceoryx2::service::port_factory::event::PortFactory<ipc::Service>;

fn open(
    node: &Node<ipc::Service>,
    name: &str,
    run: &str,
) -> Result<(Messages, Events), Box<dyn Error>> {
    let service: ServiceName = format!("arhost/handoff/{run}/{name}").as_str().try_into()?;
    Ok((
        node.service_builder(&service)
            .publish_subscribe::<Message>()
            .open_or_create()?,
        node.service_builder(&service).event().open_or_create()?,
    ))
}

impl Sender {
    fn open(node: &Node<ipc::Service>, name: &str, run: &str) -> Result<Sender, Box<dyn Error>> {
        let (messages, events) = open(node, name, run)?;
        Ok(Sender {
            publisher: messages.publisher_builder().create()?,
            notifier: events.notifier_builder().create()?,
        })
    }

    fn send(&self, message: Message, polling: bool) -> Result<(), Box<dyn Error>> {
        self.publisher
            .loan_uninit()?
            .write_payload(message)
            .send()?;
        if !polling {
            self.notifier.notify()?;
        }
        Ok(())
    }
}

impl Receiver {
    fn open(node: &Node<ipc::Service>, name: &str, run: &str) -> Result<Receiver, Box<dyn Error>> {
        let (messages, events) = open(node, name, run)?;
        Ok(Receiver {
            subscriber: messages.subscriber_builder().create()?,
            listener: events.listener_builder().create()?,
        })
    }

    fn receive(&self, polling: bool) -> Result<Message, Box<dyn Error>> {
        let end = Instant::now() + Duration::from_secs(10); // the other side may have died
        while Instant::now() < end {
            // Consume the event before the message. The sender signals after sending; a leftover event would end the
            // next wait early.
            if !polling {
                self.listener.timed_wait_one(Duration::from_secs(1))?;
            }
            for _ in 0..if polling { 1000 } else { 1 } {
                if let Some(sample) = self.subscriber.receive()? {
                    return Ok(*sample);
                }
                std::hint::spin_loop();
            }
        }
        Err("the other process does not respond".into())
    }
}

fn run_server(run: &str, rounds: usize, polling: bool) -> Result<(), Box<dyn Error>> {
    let node = NodeBuilder::new().create::<ipc::Service>()?;
    let (requests, responses) = (
        Receiver::open(&node, "forward", run)?,
        Sender::open(&node, "backward", run)?,
    );
    println!("ready"); // the client waits for this line: messages sent before the receiver exists would be lost
    for _ in 0..=rounds {
        let request = requests.receive(polling)?;
        let forward_ns = now_ns() - request.sent_ns;
        responses.send(
            Message {
                sent_ns: now_ns(),
                forward_ns,
                padding: [0; 14],
            },
            polling,
        )?;
    }
    std::thread::sleep(Duration::from_millis(100)); // the last response must stay valid until it is read
    Ok(())
}

fn percentile_us(samples: &mut [i64], fraction: f64) -> f64 {
    samples.sort_unstable();
    samples[(fraction * (samples.len() - 1) as f64) as usize] as f64 * 1e-3
}

fn run_client(rounds: usize, polling: bool) -> Result<(), Box<dyn Error>> {
    let run = format!("{}-{polling}", std::process::id());
    let node = NodeBuilder::new().create::<ipc::Service>()?;
    let (forward, backward) = (
        Sender::open(&node, "forward", &run)?,
        Receiver::open(&node, "backward", &run)?,
    );
    let mut other = Command::new(std::env::current_exe()?)
        .args([rounds.to_string(), run, polling.to_string()])
        .stdout(Stdio::piped())
        .spawn()?;
    BufReader::new(other.stdout.take().ok_or("no pipe")?).read_line(&mut String::new())?;
    let (mut forward_ns, mut backward_ns) = (Vec::new(), Vec::new());
    for round in 0..=rounds {
        std::thread::sleep(Duration::from_micros(200)); // let the other side fall asleep
        forward.send(
            Message {
                sent_ns: now_ns(),
                forward_ns: 0,
                padding: [0; 14],
            },
            polling,
        )?;
        let reply = backward.receive(polling)?;
        if round > 0 {
            backward_ns.push(now_ns() - reply.sent_ns);
            forward_ns.push(reply.forward_ns);
        }
    }
    other.wait()?;
    let name = if polling {
        "iceoryx2, polling"
    } else {
        "iceoryx2, sleeping"
    };
    print!("{name:<28}");
    for samples in [&mut forward_ns, &mut backward_ns] {
        print!(
            "  {:8.1} {:8.1} {:8.1}",
            percentile_us(samples, 0.5),
            percentile_us(samples, 0.99),
            percentile_us(samples, 0.999)
        );
    }
    println!();
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    set_log_level(LogLevel::Error);
    let arguments: Vec<String> = std::env::args().collect();
    let rounds = arguments.get(1).map_or(Ok(5000), |text| text.parse())?;
    match &arguments[..] {
        [_, _, run, polling] => run_server(run, rounds, polling.parse()?),
        _ => run_client(rounds, false).and_then(|()| run_client(rounds, true)),
    }
}
