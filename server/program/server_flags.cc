// SPDX-License-Identifier: Apache-2.0
#include "server/program/server_flags.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "common/log/start_log.h"
#include "common/status/status_macros.h"
#include "server/listen/listen_socket.h"
#include "server/store/data_directory.h"

namespace rigcal::server {
namespace {

constexpr int kUsualPort = 7420;

}  // namespace

void AddServerFlags(CLI::App* app, ServerFlags* flags) {
  app->add_option("--config", flags->config_file, "TOML file; flags override it")
      ->type_name("FILE");
  app->add_option(
         "--listen", flags->listen,
         "Address for agents and the command line (default 127.0.0.1:7420; port 0: any free "
         "one); the dashboard and the JSON API are at the port behind it, unless the "
         "configuration names one under [https]")
      ->type_name("HOST[:PORT]");
  app->add_option(
         "--advertise", flags->advertise,
         "Address that others are told, where it is not that of this PC: of a container, or "
         "behind a router; it gets into the certificate and into join strings")
      ->type_name("HOST[:PORT]");
  app->add_option("--data-dir", flags->data_dir,
                  "Folder of the database (default $XDG_DATA_HOME/rigcal or ~/.local/share/rigcal)")
      ->type_name("DIR");
  app->add_option(
         "--store", flags->store,
         "Database elsewhere, instead of the one in the data folder; the password comes from "
         "~/.pgpass or PGPASSWORD")
      ->type_name("postgresql://USER@HOST/DATABASE");
  app->add_flag(
      "--store-unsafe", flags->store_unsafe,
      "Also take a PostgreSQL server that can lose data when its power fails (fsync off)");
  app->add_flag("--no-solve", flags->no_solve,
                "Leave calibrations to rigcal-workers on the database (with --store)");
  app->add_option(
         "--docs-dir", flags->docs_dir,
         "Folder of the documentation, shown at /docs/ beside the dashboard (default: where "
         "the package rigcal-doc has it)")
      ->type_name("DIR");
  app->add_option("--follow", flags->follow,
                  "Be a standby of the server there: copy its data, and take over when asked to "
                  "(promote)")
      ->type_name("HOST:PORT");
  app->add_option("--port-file", flags->port_file,
                  "File for the port number, written once the server accepts calls")
      ->type_name("FILE");
  app->add_option("--http-port-file", flags->http_port_file,
                  "The same for the port of the dashboard and the JSON API")
      ->type_name("FILE");
  app->add_option("--log-level", flags->log_level, "Lowest level logged on stderr (default info)")
      ->check(CLI::IsMember({"trace", "debug", "info", "warn", "error", "off"}));
  app->add_option("--log-format", flags->log_format,
                  "text, json (a JSON object per line), journal (entries with fields in systemd's "
                  "journal), or auto: journal under systemd, else text (default auto)")
      ->check(CLI::IsMember({"auto", "text", "json", "journal"}));
}

absl::Status CheckAddresses(const ServerFlags& flags) {
  for (const auto& [option, given] :
       {std::pair{"--listen", &flags.listen}, std::pair{"--advertise", &flags.advertise}}) {
    if (given->empty()) continue;
    const absl::Status address = ParseHostPort(WithPort(*given, kUsualPort)).status();
    if (!address.ok()) {
      return absl::InvalidArgumentError(absl::StrCat(option, ": ", std::string(address.message())));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<ServerConfig> ReadConfig(const ServerFlags& flags) {
  ServerConfig config;
  if (!flags.config_file.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(config, ReadServerConfig(flags.config_file));
  }
  if (!flags.listen.empty()) config.listen = WithPort(flags.listen, kUsualPort);
  if (!flags.log_level.empty()) config.log_level = flags.log_level;
  if (!flags.log_format.empty()) config.log_format = flags.log_format;
  if (!flags.data_dir.empty()) config.data_dir = flags.data_dir;
  if (!flags.advertise.empty()) config.advertise = WithPort(flags.advertise, kUsualPort);
  if (!flags.store.empty()) config.store = flags.store;
  if (flags.store_unsafe) config.store_unsafe = true;
  if (flags.no_solve) config.solve.local = false;
  if (!flags.docs_dir.empty()) config.docs_dir = flags.docs_dir;
  if (!flags.follow.empty()) config.follow = flags.follow;
  if (config.data_dir.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(config.data_dir, DefaultDataDirectory());
  }
  if (!config.follow.empty()) {
    config.follow = WithPort(config.follow, kUsualPort);
    const absl::Status address = ParseHostPort(config.follow).status();
    if (!address.ok()) {
      return absl::InvalidArgumentError(absl::StrCat("--follow: ", std::string(address.message())));
    }
    if (!config.store.empty()) {
      return absl::InvalidArgumentError(
          "--follow and --store do not go together: a standby has its database in its data folder; "
          "with PostgreSQL start the second server on the same database");
    }
  }
  return config;
}

}  // namespace rigcal::server
