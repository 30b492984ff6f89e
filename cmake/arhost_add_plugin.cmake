# SPDX-License-Identifier: Apache-2.0
# arhost_add_plugin(name SOURCES … [LIBRARIES …]) builds a plugin, <name>.so, that exports only arhost_entry. Used by the SDK's
# CMake package and by arhost's own build.
#   ARHOST_PLUGIN_DIRECTORY          output folder; default: the current binary folder
#   ARHOST_PLUGIN_INSTALL_DIRECTORY  install folder; if unset, the plugin is not installed
set(ARHOST_PLUGIN_MAP ${CMAKE_CURRENT_LIST_DIR}/plugin.map)

function(arhost_add_plugin name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LIBRARIES" ${ARGN})
  if(NOT ARG_SOURCES OR ARG_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "arhost_add_plugin(${name} …): must be SOURCES file… [LIBRARIES target…]")
  endif()
  add_library(${name} MODULE ${ARG_SOURCES})
  target_include_directories(${name} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})
  target_link_libraries(${name} PRIVATE arhost::abi ${ARG_LIBRARIES})
  target_link_options(${name} PRIVATE -Wl,--version-script=${ARHOST_PLUGIN_MAP})
  set_target_properties(${name} PROPERTIES
    PREFIX "" C_VISIBILITY_PRESET hidden CXX_VISIBILITY_PRESET hidden LINK_DEPENDS ${ARHOST_PLUGIN_MAP})
  get_property(languages GLOBAL PROPERTY ENABLED_LANGUAGES)
  if(CXX IN_LIST languages)
    target_compile_features(${name} PRIVATE cxx_std_20) # for arhost-cpp/plugin.hpp
  endif()
  if(ARHOST_PLUGIN_DIRECTORY)
    set_target_properties(${name} PROPERTIES LIBRARY_OUTPUT_DIRECTORY ${ARHOST_PLUGIN_DIRECTORY})
  endif()
  if(ARHOST_PLUGIN_INSTALL_DIRECTORY)
    install(TARGETS ${name} LIBRARY DESTINATION ${ARHOST_PLUGIN_INSTALL_DIRECTORY})
  endif()
endfunction()
