// SPDX-License-Identifier: Apache-2.0
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <csignal>
#include <exception>
#include <filesystem>
#include <functional>
#include <iostream>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "agent/capture/registry/source_help.h"
#include "agent/capture/registry/source_registry.h"
#include "agent/command/subcommands.h"
#include "agent/offer/camera_offers.h"
#include "agent/spool/disk/disk_spool.h"
#include "agent/spool/memory_spool.h"
#include "agent/uplink/agent_state.h"
#include "agent/uplink/uplink.h"
#include "common/command_line/command_line.h"
#include "common/config/agent_config.h"
#include "common/enrolment/renewal_thread.h"
#include "common/failpoint/failpoint.h"
#include "common/file/durable_file.h"
#include "common/identity/identity_folder.h"
#include "common/log/level_signals.h"
#include "common/log/start_log.h"
#include "common/service/service_notice.h"
#include "common/status/status_macros.h"
#include "common/text/printable.h"
#include "common/wire/grpc_locks.h"
#include "common/wire/protocol_version.h"
#include "common/wire/server_access.h"
#include "common/wire/server_list.h"

namespace rigcal::agent {
namespace {

constexpr std::chrono::seconds kDeliveryTimeAtEnd{2};
constexpr size_t kMostInMemoryMb = 256;

constexpr char kDescription[] =
    "Streams the wand observations of this PC's cameras to a rigcal server.";
std::string Footer() {
  return absl::StrCat(
      "SPEC is [NAME=]KIND:[SUBJECT][;OPTION=VALUE]..., where KIND is one of\n", SourceSummaries(),
      "Command `sources KIND` lists the options of a kind; deploy/agent.toml shows the same in a "
      "file.\n"
      "Examples:\n"
      "  rigcal-agent --source csv:rig/left.csv --source csv:rig/right.csv\n"
      "  rigcal-agent --server 10.0.0.5:7420 --source 'left=aravis:192.168.1.5;exposure=0.004'\n"
      "  rigcal-agent --source 'sim:camera=0;cameras=4;pixels=1'\n"
      "  rigcal-agent --offer-simulated 3\n"
      "Without a source the agent offers the cameras that it sees to the server, where `rigcal "
      "cameras use` or the page chooses them; chosen ones are kept in the state directory.\n"
      "SIGTERM or SIGINT ends captures, delivers what is there for up to 2 s, and exits.\n"
      "Exit codes: 0 ended by signal or the command is done, 1 failed, 2 usage, 3 ended by signal "
      "with observations that are not delivered (with the disk spool they are at the next start).");
}

struct Flags {
  std::string config;
  std::string server;
  std::string rig;
  std::string agent_id;
  std::string state_dir;
  std::string spool;
  std::string durable_on;
  std::string log_level;
  std::string log_format;
  std::string offer_simulated;
  bool offer_fake = false;
  std::vector<std::string> sources;
};

void AddFlags(CLI::App& app, Flags& flags) {
  app.add_option("--config", flags.config, "TOML file; flags override it");
  app.add_option("--server", flags.server,
                 "HOST:PORT of the server, or several with commas between, of which the one that "
                 "answers is used [the one joined, or this PC's]");
  app.add_option("--rig", flags.rig, "Rig the cameras belong to [rig]");
  app.add_option("--agent-id", flags.agent_id,
                 "Name of this agent [the host's name; kept in the state directory]");
  app.add_option("--state-dir", flags.state_dir,
                 "Folder of this agent alone [~/.local/state/rigcal/agent/AGENT_ID]");
  app.add_option("--durable-on", flags.durable_on,
                 "Who must have observations on its disk before this agent forgets them: server, "
                 "or the server's standby (default server)")
      ->check(CLI::IsMember({"server", "standby"}));
  app.add_option("--spool", flags.spool,
                 "Where observations wait for the server: disk or memory [disk]")
      ->check(CLI::IsMember({"disk", "memory"}));
  app.add_option("--source", flags.sources,
                 "SPEC of a camera; repeatable; replaces the cameras of the file");
  app.add_option(
      "--offer-simulated", flags.offer_simulated,
      "N[;OPTION=VALUE]...: also offers N simulated cameras, with options of sim:, to try "
      "things out; a session of theirs ends after a minute, or after duration=SECONDS");
  app.add_flag("--offer-fake", flags.offer_fake, "Also offers Aravis' own fake camera");
  app.add_option("--log-level", flags.log_level, "trace, debug, info, warn, error, off [info]");
  app.add_option("--log-format", flags.log_format,
                 "text, json (a JSON object per line), journal (entries with fields in systemd's "
                 "journal), or auto: journal under systemd, else text [auto]")
      ->check(CLI::IsMember({"auto", "text", "json", "journal"}));
  app.footer(Footer());
}

// INVALID_ARGUMENT is for what was typed.
absl::Status OfFile(const absl::Status& fault) {
  if (!absl::IsInvalidArgument(fault)) return fault;
  return absl::FailedPreconditionError(std::string(fault.message()));
}

absl::StatusOr<AgentConfig> MakeConfig(const Flags& flags) {
  AgentConfig config;
  if (!flags.config.empty()) {
    absl::StatusOr<AgentConfig> read = ReadAgentConfig(flags.config);
    if (!read.ok()) return OfFile(read.status());
    config = *std::move(read);
  }
  if (!flags.server.empty()) config.server = flags.server;
  if (absl::StrContains(config.server, "://")) {
    return absl::InvalidArgumentError(
        absl::StrCat("--server ", config.server,
                     " is the address of a page; give HOST:PORT with the gRPC port, "
                     "such as 127.0.0.1:7420"));
  }
  if (!flags.rig.empty()) config.rig = flags.rig;
  if (!flags.agent_id.empty()) config.agent_id = flags.agent_id;
  if (!flags.state_dir.empty()) config.state_dir = flags.state_dir;
  if (flags.spool == "disk") config.spool.kind = SpoolConfig::Kind::kDisk;
  if (flags.spool == "memory") config.spool.kind = SpoolConfig::Kind::kMemory;
  if (flags.durable_on == "server") config.spool.durable_on = SpoolConfig::DurableOn::kServer;
  if (flags.durable_on == "standby") config.spool.durable_on = SpoolConfig::DurableOn::kStandby;
  if (!flags.log_level.empty()) config.log_level = flags.log_level;
  if (!flags.log_format.empty()) config.log_format = flags.log_format;
  RIGCAL_RETURN_IF_ERROR(config.Validate());
  return config;
}

// INVALID_ARGUMENT with the faults of all sources that were typed, FAILED_PRECONDITION with those
// of the file.
absl::StatusOr<std::vector<std::unique_ptr<ObservationSource>>> MakeSources(
    const Flags& flags, const AgentConfig& config) {
  std::vector<std::unique_ptr<ObservationSource>> sources;
  std::vector<std::string> faults;
  const auto make = [&](const absl::StatusOr<std::unique_ptr<SourceSpec>>& spec) {
    auto source = spec.ok() ? (*spec)->Create() : spec.status();
    if (source.ok()) {
      sources.push_back(*std::move(source));
    } else {
      faults.emplace_back(source.status().message());
    }
  };
  for (const std::string& text : flags.sources) make(ParseSourceSpec(text));
  if (flags.sources.empty()) {
    for (const CameraConfig& camera : config.cameras) make(ParseSourceSpec(camera));
  }
  if (faults.empty()) return sources;
  const absl::Status fault = absl::InvalidArgumentError(absl::StrJoin(faults, "\n"));
  return flags.sources.empty() ? OfFile(fault) : fault;
}

// Recorded and simulated cameras stand for a whole rig: an agent that has no others looks for none.
bool LooksForCameras(const std::vector<std::unique_ptr<ObservationSource>>& sources) {
  return sources.empty() || std::ranges::any_of(sources, [](const auto& source) {
           const std::string& kind = source->description().source;
           return absl::StartsWith(kind, "aravis:") || absl::StartsWith(kind, "metavision:");
         });
}

// None: the agent offers nothing. Those that were chosen before are added to `sources`.
absl::StatusOr<std::unique_ptr<CameraOffers>> MakeOffers(
    const Flags& flags, const AgentConfig& config,
    std::vector<std::unique_ptr<ObservationSource>>* sources) {
  CameraOffersOptions options;
  options.scan.devices = LooksForCameras(*sources);
  options.scan.fake = flags.offer_fake;
  if (!flags.offer_simulated.empty()) {
    RIGCAL_RETURN_IF_ERROR(ReadSimulatedOffer(flags.offer_simulated, &options.scan));
  }
  const bool offers_any =
      options.scan.devices || options.scan.fake || options.scan.simulated_count > 0;
  if (!offers_any) return nullptr;
  RIGCAL_ASSIGN_OR_RETURN(ChosenCameras chosen, ChosenCameras::Open(config.state_dir));
  std::vector<ConfiguredCamera> configured;
  for (const auto& source : *sources) {
    configured.push_back(
        {.camera = source->description().camera, .source = source->description().source});
  }
  auto offers =
      std::make_unique<CameraOffers>(std::move(options), std::move(chosen), std::move(configured));
  for (auto& source : offers->OpenChosen()) sources->push_back(std::move(source));
  if (sources->empty()) {
    spdlog::info(
        "no camera takes part yet: `rigcal cameras` on the server's PC, or its page, lists those "
        "that this agent sees, and chooses them");
  }
  return offers;
}

// The server knows an agent by the name in its certificate.
absl::Status CheckJoinedAs(const AgentIdentity& agent, const IdentityFolder& folder) {
  if (!folder.Exists()) return absl::OkStatus();
  RIGCAL_ASSIGN_OR_RETURN(const PeerIdentity identity, folder.Load());
  RIGCAL_ASSIGN_OR_RETURN(const Certificate certificate,
                          ParseCertificate(identity.certificate_pem));
  if (certificate.name == agent.agent_id) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("this agent is called ", agent.agent_id, ", and joined its server as ",
                   certificate.name, "; start it with --agent-id ", certificate.name,
                   ", or join again under the new name: ", "rigcal-agent join STRING --force"));
}

// Adds the servers that took turns with one of these when the agent ran before.
void LearnKnownServers(const std::filesystem::path& file, wire::ServerList* servers) {
  const absl::StatusOr<std::string> text = ReadSmallFile(file);
  if (!text.ok()) return;
  const absl::StatusOr<wire::ServerList> known = wire::ServerList::Parse(*text);
  if (!known.ok()) return;
  const bool same_rig = std::ranges::any_of(servers->servers(), [&](const std::string& server) {
    return std::ranges::find(known->servers(), server) != known->servers().end();
  });
  if (same_rig) servers->Learn(known->servers());
}

// `uplink` is set before the thread starts.
RenewalThread::Events RenewalEvents(Uplink* const* uplink) {
  return {.renewed =
              [uplink] {
                spdlog::info("the certificate is renewed; connecting again with it");
                (*uplink)->Reconnect();
              },
          .trouble = [](const std::string& why) { spdlog::error("the certificate: {}", why); }};
}

absl::StatusOr<std::unique_ptr<ObservationSpool>> MakeSpool(const AgentConfig& config) {
  const SpoolConfig& spool = config.spool;
  if (spool.kind == SpoolConfig::Kind::kMemory) {
    return std::make_unique<MemorySpool>(std::min(spool.limit_mb, kMostInMemoryMb) << 20);
  }
  DiskSpoolOptions options;
  options.folder = config.state_dir + "/spool";
  options.limit_bytes = uint64_t{spool.limit_mb} << 20;
  options.full =
      spool.full == SpoolConfig::Full::kBlock ? SpoolFull::kBlock : SpoolFull::kDropOldest;
  options.sync_interval = std::chrono::milliseconds(spool.sync_interval_ms);
  options.boot = BootNumber();
  return DiskSpool::Create(std::move(options));
}

// The exit code of an agent that has ended.
int Conclude(const LeftBehind& left, const std::string& folder) {
  if (left.row_count == 0) return kExitOk;
  const bool one = left.row_count == 1;
  spdlog::warn("{} {} of {} {} not delivered; {}", left.row_count,
               one ? "observation" : "observations", absl::StrJoin(left.cameras, ", "),
               one ? "is" : "are",
               folder.empty()
                   ? std::string("they were in memory only and are lost")
                   : absl::StrCat("they are in ", folder, " and are delivered at the next start"));
  return kExitUndelivered;
}

absl::StatusOr<int> RunAgent(const Flags& flags, sigset_t signals) {
  AddLevelSignals(!flags.config.empty(), &signals);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  RIGCAL_ASSIGN_OR_RETURN(AgentConfig config, MakeConfig(flags));
  RIGCAL_RETURN_IF_ERROR(SetLogLevel(config.log_level));
  RIGCAL_RETURN_IF_ERROR(SetLogFormat(config.log_format));
  RIGCAL_ASSIGN_OR_RETURN(auto sources, MakeSources(flags, config));
  if (config.state_dir.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(const auto directory, AgentState::DefaultDirectory(config.agent_id));
    config.state_dir = directory.string();
  }
  RIGCAL_ASSIGN_OR_RETURN(const AgentState state,
                          AgentState::Open(config.state_dir, config.agent_id));
  const AgentIdentity& identity = state.identity();
  const IdentityFolder folder = IdentityFolder::OfAgent(config.state_dir);
  RIGCAL_RETURN_IF_ERROR(OfFile(CheckJoinedAs(identity, folder)));
  const auto files = wire::ClientIdentity::OfAgent(config.state_dir);
  // Neither a flag nor the file names a server.
  if (config.server == AgentConfig().server && flags.server.empty()) {
    config.server = wire::DefaultServerAddress(files);
  }
  RIGCAL_ASSIGN_OR_RETURN(wire::ServerList servers, wire::ServerList::Parse(config.server));
  for (const std::string& server : servers.servers()) {
    RIGCAL_RETURN_IF_ERROR(OfFile(wire::CredentialsFor(server, files).status()));
  }

  RIGCAL_ASSIGN_OR_RETURN(auto offers, MakeOffers(flags, config, &sources));
  RIGCAL_ASSIGN_OR_RETURN(const std::unique_ptr<ObservationSpool> spool, MakeSpool(config));
  UplinkOptions options;
  const std::filesystem::path known_servers = std::filesystem::path(config.state_dir) / "servers";
  LearnKnownServers(known_servers, &servers);
  options.servers = servers;
  options.learned = [known_servers](const wire::ServerList& all) {
    const absl::Status written = WriteDurableFile(known_servers, all.text());
    if (!written.ok()) spdlog::warn("{}", std::string(written.message()));
  };
  options.agent_id = identity.agent_id;
  options.incarnation = identity.incarnation;
  options.stream_epoch = identity.stream_epoch;
  options.host = HostName();
  options.secret = identity.secret;
  options.rig = config.rig;
  options.keeps_until_standby = config.spool.durable_on == SpoolConfig::DurableOn::kStandby;
  options.known_servers_file = std::filesystem::path(config.state_dir) / "server.generation";
  options.previews.enabled = config.preview.enabled;
  options.previews.max_rate_hz = config.preview.max_rate_hz;
  options.previews.max_jpeg_bytes = static_cast<size_t>(config.preview.max_kb) << 10;
  options.learning.folder = std::filesystem::path(config.state_dir) / "detectors";
  Uplink* running = nullptr;
  RenewalThread renewal(folder, RenewalEvents(&running));
  const auto make_channel = [files, &renewal](const std::string& server, bool of_several) {
    // A server that refuses the certificate closes the connection without a word.
    renewal.AskSoon();
    return Uplink::MakeChannel(server, files, of_several);
  };
  RIGCAL_ASSIGN_OR_RETURN(const auto uplink,
                          Uplink::Create(std::move(options), std::move(sources), spool.get(),
                                         make_channel, std::move(offers)));
  running = uplink.get();
  uplink->Start();
  if (folder.Exists()) renewal.Start();
  TellReady(absl::StrCat("sends to ", config.server));
  const auto read_level = [&flags]() -> absl::StatusOr<std::string> {
    RIGCAL_ASSIGN_OR_RETURN(const AgentConfig now, ReadAgentConfig(flags.config));
    return now.log_level;
  };
  int signal = 0;
  do {
    signal = WaitForSignal(signals, [&] { spool->Status(); });
  } while (TakeLevelSignal(signal, read_level));
  TellStopping();
  spdlog::info("signal {}: ending captures", signal);
  const LeftBehind left = uplink->Shutdown(kDeliveryTimeAtEnd);
  renewal.Shutdown();
  return Conclude(left, spool->Status().folder);
}

int Run(const Flags& flags, const sigset_t& signals) {
  const absl::StatusOr<int> code = RunAgent(flags, signals);
  if (code.ok()) return *code;
  spdlog::error("{}", std::string(code.status().message()));
  return ExitCodeOf(code.status());
}

int RunSubcommand(const std::function<absl::Status()>& run, const sigset_t& signals) {
  // Output is written as it goes: a signal may end the command at once.
  pthread_sigmask(SIG_UNBLOCK, &signals, nullptr);
  absl::Status status;
  try {
    status = run();
  } catch (const std::exception& error) {
    status = absl::InternalError(error.what());
  }
  std::cout.flush();
  if (status.ok() && !std::cout) status = absl::DataLossError("cannot write to stdout");
  if (!status.ok()) std::cerr << "rigcal-agent: " << std::string(status.message()) << std::endl;
  return ExitCodeOf(status);
}

int Main(int argc, char** argv) {
  // Before any thread: all of them inherit the mask, and the signals wait for sigwait.
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  wire::TakeLocksWithoutChecks();
  StartLog("rigcal-agent");
  if (const absl::Status status = ActivateFailpoints(); !status.ok()) {
    spdlog::error("{}", std::string(status.message()));
    return kExitUsage;
  }

  CLI::App app(kDescription, "rigcal-agent");
  Flags flags;
  AddFlags(app, flags);
  Subcommands subcommands(std::cout);
  subcommands.AddTo(app);
  AddVersionFlags(app, std::string(wire::kSoftwareVersion));
  const auto task = ParseCommandLine(app, argc, argv, std::cout);
  if (!task.ok()) {
    std::cerr << "rigcal-agent: " << PrintableLines(std::string(task.status().message()))
              << std::endl;
    return kUsageExitCode;
  }
  if (*task == CommandLineTask::kDone) return kExitOk;
  return subcommands.Chosen() ? RunSubcommand(subcommands.Chosen(), signals) : Run(flags, signals);
}

}  // namespace
}  // namespace rigcal::agent

int main(int argc, char** argv) { return rigcal::agent::Main(argc, argv); }
