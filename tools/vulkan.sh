# shellcheck shell=bash
# Which Vulkan drivers this machine has. Sourced, never run.
#
# A driver announces itself by a JSON manifest. Mesa's one Debian package brings manifests
# for hardware that may not be there, so a manifest alone does not mean a GPU: its device
# node must exist too.

MANIFEST_FOLDERS="/usr/share/vulkan/icd.d /usr/local/share/vulkan/icd.d /etc/vulkan/icd.d"

# vulkan_manifests GLOB: the manifests whose file name matches, one per line.
vulkan_manifests() {
  local folder file
  for folder in $MANIFEST_FOLDERS; do
    for file in "$folder"/$1; do
      if [ -e "$file" ]; then printf '%s\n' "$file"; fi
    done
  done
}

# The person has chosen a driver by the loader's own variables.
vulkan_driver_chosen() { [ -n "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ]; }

# The device node of NVIDIA's driver (or of Windows' GPU inside WSL).
nvidia_device() { [ -e /dev/nvidiactl ] || [ -e /dev/dxg ]; }

render_node() {
  local node
  for node in /dev/dri/renderD*; do
    if [ -e "$node" ]; then return 0; fi
  done
  return 1
}

# Succeeds if a GPU and a Vulkan driver for it seem to be there. A virtual display adapter
# may pass for a GPU here; then nothing is pinned and the loader finds the software driver.
gpu_driver() {
  if nvidia_device && [ -n "$(vulkan_manifests '*nvidia*.json')" ]; then return 0; fi
  render_node && vulkan_manifests '*.json' | grep -v -e '/lvp_' -e nvidia | grep -q .
}

# The software driver's manifest: `lvp_icd.json`, or with the architecture in its name.
software_manifest() {
  local own
  own=$(vulkan_manifests "lvp_icd.$(uname -m).json" | head -n 1)
  if [ -z "$own" ]; then own=$(vulkan_manifests 'lvp_icd*.json' | head -n 1); fi
  printf '%s' "$own"
}

# Pins the software driver for the commands that follow, if there is no GPU driver and
# nothing else was chosen. For tests alone: the product takes what the loader offers.
pin_software_driver() {
  local manifest
  if vulkan_driver_chosen; then
    say "Vulkan driver: as chosen by VK_DRIVER_FILES or VK_ICD_FILENAMES"
  elif gpu_driver; then
    say "Vulkan driver: the GPU's"
  else
    manifest=$(software_manifest)
    if [ -z "$manifest" ]; then die "no Vulkan driver found, not even the software one"; fi
    say "Vulkan driver: software, $manifest (no GPU driver found)"
    # Loaders before 1.3.207 know only the second name.
    export VK_DRIVER_FILES="$manifest" VK_ICD_FILENAMES="$manifest"
    # Mesa's device selection layer wants a desktop session and complains without one.
    export NODEVICE_SELECT=1
  fi
}
