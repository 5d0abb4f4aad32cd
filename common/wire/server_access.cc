// SPDX-License-Identifier: Apache-2.0
#include "common/wire/server_access.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/identity/identity_folder.h"
#include "common/status/status_macros.h"
#include "common/text/nesting.h"

namespace rigcal::wire {
namespace {

constexpr char kLoopbackServer[] = "127.0.0.1:7420";
// Of a server that runs as a service: deploy/systemd/rigcal-server.service.
constexpr char kServiceData[] = "/var/lib/rigcal";
constexpr std::string_view kUnix = "unix:";

// $VARIABLE, else $HOME/BELOW; empty: neither is set.
std::filesystem::path BaseFolder(const char* variable, const char* below) {
  const char* folder = std::getenv(variable);
  if (folder != nullptr && folder[0] == '/') return folder;
  const char* home = std::getenv("HOME");
  if (home == nullptr || home[0] != '/') return {};
  return std::filesystem::path(home) / below;
}

// The gRPC addresses in servers.json; none where it is missing or damaged.
std::vector<std::string> JoinedServers(const ClientIdentity& identity) {
  if (!identity.Exists()) return {};
  std::ifstream stream(identity.folder / "servers.json");
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  const auto servers = ParseJson<nlohmann::json>(text);
  std::vector<std::string> addresses;
  if (!servers.is_object() || !servers.contains("grpc") || !servers["grpc"].is_array()) {
    return addresses;
  }
  for (const auto& address : servers["grpc"]) {
    if (address.is_string()) addresses.push_back(address.get<std::string>());
  }
  return addresses;
}

// A server of this user, or of root, listens on the socket file.
bool Answers(const std::filesystem::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string name = path.string();
  struct stat status {};
  if (name.size() >= sizeof(address.sun_path) || lstat(name.c_str(), &status) != 0 ||
      !S_ISSOCK(status.st_mode) || (status.st_uid != geteuid() && status.st_uid != 0)) {
    return false;
  }
  std::memcpy(address.sun_path, name.c_str(), name.size() + 1);
  const int descriptor = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (descriptor < 0) return false;
  // EAGAIN: it listens, and many others wait for it.
  const bool answers =
      connect(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0 ||
      errno == EAGAIN;
  close(descriptor);
  return answers;
}

// A name that nobody knows is no server that wants a certificate.
absl::Status CheckHasAddress(const std::string& address) {
  std::string host = address.substr(0, address.rfind(':'));
  if (host.size() > 2 && host.front() == '[') host = host.substr(1, host.size() - 2);
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  const int error = getaddrinfo(host.c_str(), nullptr, &hints, &found);
  if (error == 0) {
    freeaddrinfo(found);
    return absl::OkStatus();
  }
  return absl::UnavailableError(absl::StrCat(
      "no PC named '", host, "' is known here (", gai_strerror(error), "), so ", address,
      " cannot be reached: correct the name, give its IP address, or add it to /etc/hosts"));
}

}  // namespace

ClientIdentity ClientIdentity::OfUser() {
  const std::filesystem::path base = BaseFolder("XDG_CONFIG_HOME", ".config");
  if (base.empty()) return {.folder = {}, .stem = "user"};
  return {base / "rigcal" / "identity", "user"};
}

bool ClientIdentity::Exists() const {
  std::error_code ignored;
  return !folder.empty() && std::filesystem::exists(folder / (stem + ".crt"), ignored);
}

bool IsOnThisMachine(std::string_view address) {
  if (address.starts_with(kUnix)) return true;
  std::string host(address.substr(0, address.rfind(':')));
  if (host.size() > 2 && host.front() == '[') host = host.substr(1, host.size() - 2);
  in_addr four{};
  return host == "localhost" || host == "::1" ||
         (inet_pton(AF_INET, host.c_str(), &four) == 1 && (ntohl(four.s_addr) >> 24) == 127);
}

std::string DefaultServerAddress(const ClientIdentity& identity) {
  const std::vector<std::string> joined = JoinedServers(identity);
  if (!joined.empty()) return joined.front();
  std::vector<std::filesystem::path> folders;
  const std::filesystem::path data = BaseFolder("XDG_DATA_HOME", ".local/share");
  if (!data.empty()) folders.push_back(data / "rigcal");
  folders.emplace_back(kServiceData);
  for (const std::filesystem::path& folder : folders) {
    const std::filesystem::path socket_file = folder / "rigcal.sock";
    if (Answers(socket_file)) return absl::StrCat(std::string(kUnix), socket_file.string());
  }
  return kLoopbackServer;
}

absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> CredentialsFor(
    const std::string& address, const ClientIdentity& identity) {
  const std::vector<std::string> joined = JoinedServers(identity);
  const bool is_joined = std::ranges::find(joined, address) != joined.end();
  if (address.starts_with(kUnix) || (IsOnThisMachine(address) && !is_joined)) {
    return grpc::InsecureChannelCredentials();
  }
  if (!identity.Exists()) {
    RIGCAL_RETURN_IF_ERROR(CheckHasAddress(address));
    return absl::FailedPreconditionError(absl::StrCat(
        "the server at ", address, " is on another machine and wants a certificate, and this PC ",
        "has none; make a join string on the server's PC (rigcal token create), and here run ",
        identity.stem == "agent" ? "rigcal-agent join STRING" : "rigcal login STRING"));
  }
  // Not the files as they are: gRPC trusts every certificate in the text of the CA.
  RIGCAL_ASSIGN_OR_RETURN(const PeerIdentity checked,
                          IdentityFolder::In(identity.folder, identity.stem).Load());
  return grpc::SslCredentials({.pem_root_certs = checked.ca_pem,
                               .pem_private_key = checked.key_pem,
                               .pem_cert_chain = checked.certificate_pem});
}

}  // namespace rigcal::wire
