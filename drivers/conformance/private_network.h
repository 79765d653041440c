// Tests that talk to peers on fixed ports (GigE Vision's is 3956) get a network of their own, so that they can run beside each
// other and nothing is broadcast on the machine's.
#pragma once

namespace lightstage {

// Moves this process into a new network namespace with only a loopback. Where that is not permitted, waits until no other such
// process is on the shared loopback. To be called before main, when there is no second thread; the result is always true.
bool EnterPrivateNetwork();

}  // namespace lightstage
