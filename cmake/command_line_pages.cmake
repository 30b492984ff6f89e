# SPDX-License-Identifier: Apache-2.0
# Man pages and shell completions, generated from the definitions of options that the programs print (--describe).
find_program(GZIP gzip REQUIRED)
set(pages_directory ${CMAKE_BINARY_DIR}/pages)
file(MAKE_DIRECTORY ${pages_directory})
set(pages)
foreach(program arhost arhost-inprocess ${ARHOST_COMMANDS})
  set(page ${pages_directory}/${program}.1.gz)
  add_custom_command(OUTPUT ${page} DEPENDS ${program} command-line-pages VERBATIM
                     COMMAND ${program} --describe | $<TARGET_FILE:command-line-pages> man > ${program}.1
                     COMMAND ${GZIP} -9nf ${program}.1
                     WORKING_DIRECTORY ${pages_directory})
  list(APPEND pages ${page})
endforeach()
# Programs that only arhost starts.
foreach(program arhost-launcher arhost-worker)
  file(CREATE_LINK arhost.1.gz ${pages_directory}/${program}.1.gz SYMBOLIC)
  install(FILES ${pages_directory}/${program}.1.gz DESTINATION share/man/man1)
endforeach()
install(FILES ${pages} DESTINATION share/man/man1)

# zsh autoloads the file as a function, so its last line calls the function.
foreach(shell bash zsh fish)
  set(commands)
  foreach(command ${ARHOST_COMMANDS})
    list(APPEND commands COMMAND ${command} --describe | $<TARGET_FILE:command-line-pages> ${shell} >> arhost.${shell})
  endforeach()
  set(last_line)
  if(shell STREQUAL zsh)
    set(last_line COMMAND ${CMAKE_COMMAND} -E echo "_arhost \"$@\"" >> arhost.zsh)
  endif()
  add_custom_command(OUTPUT ${pages_directory}/arhost.${shell} DEPENDS arhost ${ARHOST_COMMANDS} command-line-pages VERBATIM
                     COMMAND arhost --describe | $<TARGET_FILE:command-line-pages> ${shell} > arhost.${shell}
                     ${commands}
                     ${last_line}
                     WORKING_DIRECTORY ${pages_directory})
  list(APPEND pages ${pages_directory}/arhost.${shell})
endforeach()
install(FILES ${pages_directory}/arhost.bash DESTINATION share/bash-completion/completions RENAME arhost)
install(FILES ${pages_directory}/arhost.zsh DESTINATION share/zsh/vendor-completions RENAME _arhost)
install(FILES ${pages_directory}/arhost.fish DESTINATION share/fish/vendor_completions.d)
add_custom_target(pages ALL DEPENDS ${pages})
