# SPDX-License-Identifier: MIT
# What belongs to the system beside the programs, placed when it is known where they go. -DSOURCE: host/packaging. Files under
# PREFIX are found by systemd and udev for /usr and /usr/local, where the configuration is in /etc; else it is under PREFIX, too.
set(prefix ${CMAKE_INSTALL_PREFIX})
set(bindir ${prefix}/bin)
set(docdir ${prefix}/share/doc/open-light-stage)
if(prefix MATCHES "^/usr(/local)?$")
  set(sysconfdir /etc)
else()
  set(sysconfdir ${prefix}/etc)
endif()
if("$ENV{DESTDIR}" STREQUAL "" AND prefix MATCHES "^/(home|root|tmp)/")
  message(STATUS "ProtectHome= and PrivateTmp= of stagectl.service hide ${prefix}: for the daemon install to /usr/local")
endif()

configure_file(${SOURCE}/stagectl.service.in ${BUILT}/stagectl.service @ONLY)
file(INSTALL ${BUILT}/stagectl.service DESTINATION ${prefix}/lib/systemd/system)
file(INSTALL ${SOURCE}/stagectl.sysusers.conf DESTINATION ${prefix}/lib/sysusers.d RENAME stagectl.conf)
file(INSTALL ${SOURCE}/stagectl.service.d DESTINATION ${docdir})
file(INSTALL ${SOURCE}/../../docs/operating.md ${SOURCE}/../../docs/checking_the_machine.md ${SOURCE}/../../examples/stage.toml DESTINATION ${docdir})

# Someone's own is left as it is.
if(NOT EXISTS $ENV{DESTDIR}${sysconfdir}/stagectl/stage.toml)
  file(INSTALL ${SOURCE}/../../examples/stage.toml DESTINATION ${sysconfdir}/stagectl)
endif()

if("$ENV{DESTDIR}" STREQUAL "")
  message(STATUS "For the daemon, and after each installation: sudo systemd-sysusers && sudo udevadm control --reload && "
                 "sudo systemctl daemon-reload; then: sudo systemctl enable --now stagectl")
endif()
