// SPDX-License-Identifier: Apache-2.0
#include "server/listen/connections.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/listen/listen_socket.h"
#include "tests/testing/process.h"
#include "tests/testing/raw_socket.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::connections_test {
namespace {

using server::Connections;
using server::ConnectionTraffic;
using server::Peer;
using std::chrono::seconds;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using Clock = std::chrono::steady_clock;

Peer Agent(const std::string& name) {
  return {.has_certificate = true,
          .role = Role::kAgent,
          .name = name,
          .uri = "rigcal://agents/" + name,
          .serial = "1a"};
}

class ConnectionsTest : public ::testing::Test {
 protected:
  void SetUp() override { ASSERT_OK_AND_ASSIGN(listening_, server::ListenOn("127.0.0.1:0")); }
  void TearDown() override {
    for (const int copy : copies_) close(copy);
    close(listening_);
  }
  // Connects a client and adds the connection; gRPC's descriptor is in copies_.
  std::string Connect() {
    clients_.push_back(std::make_unique<RawSocket>(server::PortOf(listening_)));
    sockaddr_storage from{};
    int descriptor = -1;
    EXPECT_TRUE(WaitFor([&] {
      socklen_t size = sizeof(from);
      descriptor = accept4(listening_, reinterpret_cast<sockaddr*>(&from), &size, SOCK_NONBLOCK);
      return descriptor >= 0;
    }));
    copies_.push_back(dup(descriptor));
    descriptors_.push_back(descriptor);
    connections_.Add(descriptor, from);
    return server::AddressText(from);
  }
  std::string Read(int descriptor) const {
    std::string bytes(1000, '\0');
    ssize_t count = 0;
    WaitFor([&] {
      count = recv(descriptor, bytes.data(), bytes.size(), MSG_DONTWAIT);
      return count >= 0 || errno != EAGAIN;
    });
    bytes.resize(static_cast<size_t>(std::max<ssize_t>(count, 0)));
    return bytes;
  }
  sockaddr_storage Loopback() const {
    sockaddr_storage from{};
    socklen_t size = sizeof(from);
    getsockname(listening_, reinterpret_cast<sockaddr*>(&from), &size);
    return from;
  }

  int listening_ = -1;
  Connections connections_{{.total = 8, .per_address = 4}};
  std::vector<std::unique_ptr<RawSocket>> clients_;
  std::vector<int> descriptors_;
  std::vector<int> copies_;
};

TEST_F(ConnectionsTest, CountsWhatWasReadAndWhatIsExplained) {
  const std::string address = Connect();
  clients_[0]->Send(std::string(700, 'x'));
  EXPECT_EQ(Read(copies_[0]).size(), 700u);
  clients_[0]->Send(std::string(300, 'x'));  // waits in the kernel
  connections_.Explain(address, 500);
  connections_.Explain("127.0.0.1:1", 500);  // nobody's
  ASSERT_THAT(connections_.Traffic(), SizeIs(1));
  EXPECT_EQ(connections_.Traffic()[0].received_bytes, 700u);
  EXPECT_EQ(connections_.Traffic()[0].explained_bytes, 500u);
}

TEST_F(ConnectionsTest, ACutConnectionGivesNothingMoreToItsReader) {
  Connect();
  clients_[0]->Send(std::string(900, 'x'));
  const uint64_t id = connections_.Traffic().at(0).id;
  const auto flooding = connections_.CutFlood(id, "it sends nonsense");
  ASSERT_TRUE(flooding);
  EXPECT_FALSE(flooding->peer);
  EXPECT_THAT(Read(copies_[0]), IsEmpty());  // shutdown() would still give the 900 bytes
  EXPECT_TRUE(clients_[0]->AwaitEnd());
  EXPECT_FALSE(connections_.CutFlood(id, "again"));
  EXPECT_THAT(connections_.Traffic(), IsEmpty());
  EXPECT_EQ(connections_.Stats().flooding, 1u);
  EXPECT_THAT(connections_.Floods(),
              ElementsAre(Field(&server::FloodRecord::why, "it sends nonsense")));
}

TEST_F(ConnectionsTest, OneHandshakeAtATimeNamesItsConnection) {
  Connect();
  connections_.NoteHandshake(Agent("pc1"), Clock::now());
  Connect();
  connections_.NoteHandshake(Agent("pc2"), Clock::now());
  const std::vector<ConnectionTraffic> traffic = connections_.Traffic();
  EXPECT_EQ(connections_.CutFlood(traffic.at(1).id, "")->peer->name, "pc2");
  EXPECT_EQ(connections_.CutFlood(traffic.at(0).id, "")->peer->name, "pc1");
}

TEST_F(ConnectionsTest, HandshakesAtOnceNameNobodyUnlessAllAreOnePeers) {
  Connect();
  Connect();
  connections_.NoteHandshake(Agent("pc1"), Clock::now());
  const std::vector<ConnectionTraffic> traffic = connections_.Traffic();
  connections_.NoteHandshake(Agent("pc1"), Clock::now());
  EXPECT_EQ(connections_.CutFlood(traffic.at(0).id, "")->peer->name, "pc1");
  Connect();
  connections_.NoteHandshake(Agent("pc2"), Clock::now());  // of the second or of the third
  EXPECT_FALSE(connections_.CutFlood(traffic.at(1).id, "")->peer);
}

TEST_F(ConnectionsTest, WhoIsCutByNameIsCutBeforeItsFirstCall) {
  Connect();
  connections_.NoteHandshake(Agent("pc1"), Clock::now());
  const std::string second = Connect();
  connections_.SetPeer(second, Agent("pc1"));
  EXPECT_THAT(connections_.CutIf([](const Peer& peer) { return peer.name == "pc1"; }), SizeIs(2));
}

TEST_F(ConnectionsTest, TheIdleOneThatWasNeverUsedGoesFirst) {
  const std::string used = Connect();
  Connect();
  Connect();
  connections_.Explain(used, 100);
  const auto full = Connections::Verdict::kTooManyFromThere;
  EXPECT_FALSE(connections_.FindIdle(Loopback(), full, Clock::now()));  // all are new
  EXPECT_EQ(connections_.FindIdle(Loopback(), full, Clock::now() + seconds(5)), descriptors_[1]);
  connections_.Remove(descriptors_[1]);
  connections_.Remove(descriptors_[2]);
  EXPECT_FALSE(connections_.FindIdle(Loopback(), full, Clock::now() + seconds(5)));
  EXPECT_EQ(connections_.FindIdle(Loopback(), full, Clock::now() + seconds(60)), descriptors_[0]);
}

}  // namespace
}  // namespace rigcal::testing::connections_test
