#!/bin/sh
# Boots the systemd of a Debian below a folder, in namespaces of its own (root only), until it is killed:
#   debootstrap --variant=minbase --include=systemd,systemd-sysv,dbus,python3-venv,mosquitto,iproute2 bookworm DIR
#   chroot DIR python3 -m venv /opt/acqd/.venv && chroot DIR /opt/acqd/.venv/bin/pip install acqd-*.whl
#   sh tools/studies/service/boot.sh DIR &
#   nsenter -t $(pgrep -f 'systemd --log-target=console' | tail -n 1) -a /opt/acqd/.venv/bin/acqd service install
# systemd-nspawn does the same where the host runs systemd.
set -eu
ROOT=$(realpath "$1")
GROUPS_AT=$(mktemp -d)
export ROOT GROUPS_AT
exec unshare --mount --propagation private sh -euc '
mount -t cgroup2 none "$GROUPS_AT"
mkdir -p "$GROUPS_AT/acqd-boot"
echo $$ >"$GROUPS_AT/acqd-boot/cgroup.procs"
exec unshare --mount --pid --uts --ipc --net --cgroup --fork --kill-child sh -euc "
mount --bind $ROOT $ROOT
cd $ROOT
mount -t proc proc proc
mount -t sysfs -o ro sysfs sys
mount -t cgroup2 none sys/fs/cgroup
mount -t tmpfs tmpfs run
mount -t tmpfs tmpfs tmp
mount -t tmpfs -o mode=755 tmpfs dev
for device in null zero full random urandom tty; do touch dev/\$device; mount --bind /dev/\$device dev/\$device; done
mkdir dev/pts dev/shm
mount -t devpts -o newinstance,ptmxmode=0666 devpts dev/pts
mount -t tmpfs tmpfs dev/shm
ln -s pts/ptmx dev/ptmx
ln -s /proc/self/fd dev/fd
mkdir -p old
pivot_root . old
umount -l /old
mount --make-rshared / # credentials of a service are mounted in its namespace
ip link set lo up
exec env -i container=other PATH=/usr/sbin:/usr/bin:/sbin:/bin /lib/systemd/systemd --log-target=console
"'
