// SPDX-License-Identifier: Apache-2.0
#include "common/discovery/join_found_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>
#include <string>

#include "tests/common/discovery/fake_discovery.h"
#include "tests/server/http/join_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::join_found_server_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::SizeIs;

class JoinFoundServer : public JoinFixture {
 protected:
  void SetUp() override {
    StartServer();
    discovery_.found = {{"hall", {"127.0.0.1"}, 7420, static_cast<uint16_t>(port())}};
  }
  // With an address where nobody listens.
  rigcal::JoinString MovedJoin() {
    rigcal::JoinString join = MakeJoin();
    join.https_port = 1;
    return join;
  }
  absl::StatusOr<PeerIdentity> Join(const rigcal::JoinString& join, const char* typed) {
    std::istringstream in(typed == nullptr ? "" : typed);
    return rigcal::JoinFoundServer(join, "pc-1", &discovery_,
                                   {.out = out_, .in = typed == nullptr ? nullptr : &in});
  }

  FakeDiscovery discovery_;
  std::ostringstream out_;
};

TEST_F(JoinFoundServer, DoesNotLookWhereTheServerAnswers) {
  const rigcal::JoinString join = MakeJoin();
  EXPECT_THAT(Join(join, "1\n"), IsOk());
  EXPECT_THAT(Join(join, "1\n"), StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("used")));
  EXPECT_EQ(discovery_.find_count, 0);
}

TEST_F(JoinFoundServer, AsksWhichAndJoinsIt) {
  discovery_.found->insert(discovery_.found->begin(), {"lab", {"127.0.0.1"}, 7420, 2});
  ASSERT_OK_AND_ASSIGN(const PeerIdentity identity, Join(MovedJoin(), "2\n"));
  EXPECT_EQ(identity.ca_pem, authority().ca_pem());
  EXPECT_THAT(out_.str(), AllOf(HasSubstr("refused"), HasSubstr("1  lab"),
                                HasSubstr("2  hall  " + address()), HasSubstr("number")));
}

// Whatever answers there: the hash in the join string decides.
TEST_F(JoinFoundServer, DoesNotTrustWhatIsFound) {
  const rigcal::JoinString good = MovedJoin();
  rigcal::JoinString of_another_ca = good;
  of_another_ca.ca_sha256[0] = static_cast<char>(of_another_ca.ca_sha256[0] ^ 1);
  EXPECT_THAT(Join(of_another_ca, "1\n"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("Nothing was sent to it")));
  EXPECT_THAT(authority().ListIdentities(), SizeIs(0));
  EXPECT_THAT(Join(good, "1\n"), IsOk()) << "its secret was not used";
}

TEST_F(JoinFoundServer, JoinsNoneThatNobodyHasChosen) {
  for (const char* typed : {"", "\n", "0\n", "2\n", "-1\n", "hall\n"}) {
    EXPECT_THAT(Join(MovedJoin(), typed),
                StatusIs(absl::StatusCode::kUnavailable, HasSubstr("no server was chosen")));
  }
  EXPECT_THAT(Join(MovedJoin(), nullptr),
              StatusIs(absl::StatusCode::kUnavailable,
                       AllOf(HasSubstr("refused"), HasSubstr("1  hall  " + address()),
                             HasSubstr("--server HOST:PORT"))));
  EXPECT_THAT(authority().ListIdentities(), SizeIs(0));
}

TEST_F(JoinFoundServer, SaysWhyNothingIsFound) {
  discovery_.found->clear();
  EXPECT_THAT(Join(MovedJoin(), "1\n"),
              StatusIs(absl::StatusCode::kUnavailable,
                       AllOf(HasSubstr("refused"), HasSubstr("no server announces itself"))));
  discovery_.found = absl::UnavailableError("no avahi-daemon");
  EXPECT_THAT(Join(MovedJoin(), "1\n"),
              StatusIs(absl::StatusCode::kUnavailable,
                       AllOf(HasSubstr("refused"), HasSubstr("no avahi-daemon"))));
}

}  // namespace
}  // namespace rigcal::testing::join_found_server_test
