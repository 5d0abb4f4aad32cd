// SPDX-License-Identifier: Apache-2.0
#include "client/commands/bundle_facts.h"

#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string_view>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "client/net/paging.h"
#include "client/output/output.h"
#include "client/output/quantities.h"
#include "common/file/durable_file.h"
#include "common/wire/protocol_version.h"
#include "common/wire/server_access.h"

namespace rigcal::client {
namespace {

constexpr size_t kMaxOutputBytes = size_t{4} << 20;
constexpr int kLastCalibrations = 10;

// What a command of the shell prints, with its errors.
std::string OutputOf(const std::string& command) {
  FILE* const pipe = popen((command + " 2>&1").c_str(), "re");
  if (pipe == nullptr) return absl::StrCat(command, ": ", std::strerror(errno), "\n");
  std::string text;
  std::array<char, 4096> part{};
  size_t count = 0;
  while ((count = fread(part.data(), 1, part.size(), pipe)) > 0) {
    if (text.size() < kMaxOutputBytes) text.append(part.data(), count);
  }
  pclose(pipe);
  return text.empty() ? "(nothing)\n" : text;
}

// One word for the shell, whatever is in it.
std::string Quoted(const std::string& word) {
  std::string result = "'";
  for (const char c : word) result += c == '\'' ? "'\\''" : std::string(1, c);
  return result + "'";
}

ExportFile FileOf(const std::string& name, const absl::Status& fault) {
  return {name + ".txt", absl::StrCat("not read: ", std::string(fault.message()), "\n")};
}

template <typename Message>
ExportFile FileOf(const std::string& name, const absl::StatusOr<Message>& message) {
  if (!message.ok()) return FileOf(name, message.status());
  return {name + ".json", ToJson(*message) + "\n"};
}

absl::StatusOr<v1::ListCalibrationsResponse> LastCalibrations(ServerConnection& server) {
  v1::ListCalibrationsRequest request;
  request.set_page_size(kLastCalibrations);
  request.set_order_by("create_time desc");
  auto list = server.Call(&v1::CalibrationService::Stub::ListCalibrations, request);
  if (!list.ok()) return list;
  for (v1::Calibration& calibration : *list->mutable_calibrations()) {
    // Lists leave out what a page of them cannot hold.
    auto whole = server.CallWithId(&v1::CalibrationService::Stub::GetCalibration, calibration.id());
    if (!whole.ok()) continue;
    calibration = std::move(*whole->mutable_calibration());
    calibration.clear_cameras();
    calibration.clear_trajectory();
  }
  return list;
}

// The answer of the page's port on this PC, which is behind the server's; without TLS.
absl::StatusOr<std::string> MetricsOf(const std::string& address) {
  const size_t colon = address.rfind(':');
  int port = 0;
  if (address.starts_with("unix:") || !wire::IsOnThisMachine(address) ||
      !absl::SimpleAtoi(address.substr(colon + 1), &port)) {
    return absl::UnavailableError(
        "the server is not asked over its port on this PC; curl its /metrics");
  }
  const int connection = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (connection < 0) return absl::UnavailableError(std::strerror(errno));
  const timeval limit{.tv_sec = 5, .tv_usec = 0};
  setsockopt(connection, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof(limit));
  setsockopt(connection, SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof(limit));
  sockaddr_in there{};
  there.sin_family = AF_INET;
  there.sin_port = htons(static_cast<uint16_t>(port + 1));
  there.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const std::string request = absl::StrCat("GET /metrics HTTP/1.1\r\nHost: 127.0.0.1:", port + 1,
                                           "\r\nConnection: close\r\n\r\n");
  std::string answer;
  if (connect(connection, reinterpret_cast<const sockaddr*>(&there), sizeof(there)) == 0 &&
      send(connection, request.data(), request.size(), MSG_NOSIGNAL) ==
          static_cast<ssize_t>(request.size())) {
    std::array<char, 4096> part{};
    ssize_t count = 0;
    while ((count = recv(connection, part.data(), part.size(), 0)) > 0 &&
           answer.size() < kMaxOutputBytes) {
      answer.append(part.data(), static_cast<size_t>(count));
    }
  }
  close(connection);
  const size_t body = answer.find("\r\n\r\n");
  if (!answer.starts_with("HTTP/1.1 200") || body == std::string::npos) {
    return absl::UnavailableError(absl::StrCat("no metrics at http://127.0.0.1:", port + 1,
                                               "/metrics: the page has another port, or TLS"));
  }
  return answer.substr(body + 4);
}

}  // namespace

ExportFile VersionsOfThisPc() {
  std::string text = absl::StrCat("rigcal ", std::string(wire::kSoftwareVersion), "\n");
  std::error_code error;
  const auto folder = std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
  for (const char* program : {"rigcal-server", "rigcal-worker", "rigcal-agent"}) {
    const std::string path = (folder / program).string();
    absl::StrAppend(&text, program, ": ", OutputOf(Quoted(path) + " --version"));
  }
  utsname system{};
  uname(&system);
  absl::StrAppend(&text, "\n", system.sysname, " ", system.release, " ", system.version, " ",
                  system.machine, "\n", OutputOf("cat /etc/os-release"));
  absl::StrAppend(&text, "\nProtocol Buffers ", GOOGLE_PROTOBUF_VERSION, ", gRPC ", grpc::Version(),
                  "\n",
                  OutputOf("dpkg-query -W 'rigcal*' 'libgrpc*' 'libprotobuf*' 'libceres*' "
                           "'libopencv-core*' 'libaravis*' 'libsqlite3-0' 'libssl3*'"));
  return {"versions.txt", text};
}

ExportFile DisksOfThisPc() { return {"disks.txt", OutputOf("df -h; df -i")}; }

ExportFile LastLogLines() {
  return {"log.txt", OutputOf("SYSTEMD_PAGER= journalctl -u rigcal-server -u rigcal-agent -n 1000 "
                              "-o short-iso-precise")};
}

std::vector<ExportFile> Configurations(const std::vector<std::string>& files) {
  std::vector<std::string> paths = files;
  if (paths.empty()) paths = {"/etc/rigcal/server.toml", "/etc/rigcal/agent.toml"};
  std::vector<ExportFile> result;
  for (size_t i = 0; i < paths.size(); ++i) {
    // Two files may have one name.
    const std::string name =
        absl::StrCat("config/", i + 1, "_", std::filesystem::path(paths[i]).filename().string());
    const absl::StatusOr<std::string> text = ReadSmallFile(paths[i]);
    result.push_back(text.ok() ? ExportFile{name, absl::StrCat("# ", paths[i], "\n", *text)}
                               : FileOf(name, text.status()));
  }
  return result;
}

std::vector<ExportFile> StateOfServer(ServerConnection& server) {
  const auto status = server.Call(&v1::StatusService::Stub::GetStatus, {});
  if (!status.ok()) {
    return {{"server.txt", absl::StrCat("no server answers, so nothing is known of its state: ",
                                        std::string(status.status().message()), "\n")}};
  }
  std::vector<ExportFile> files = {FileOf("server/status", status)};
  files.push_back(
      FileOf("server/agents", ReadAllPages(server, &v1::AgentService::Stub::ListAgents)));
  files.push_back(
      FileOf("server/sessions", ReadAllPages(server, &v1::SessionService::Stub::ListSessions)));
  files.push_back(FileOf("server/calibrations", LastCalibrations(server)));
  const absl::StatusOr<std::string> metrics = MetricsOf(server.address());
  files.push_back(metrics.ok() ? ExportFile{"server/metrics.txt", *metrics}
                               : FileOf("server/metrics", metrics.status()));
  return files;
}

}  // namespace rigcal::client
