// SPDX-License-Identifier: MIT
// Second-stage boot loader: the first 252 bytes of flash, copied to SRAM and run by the boot ROM (RP2040 datasheet
// 2.8.1.3). Sets the flash interface to plain serial reads (command 03h), which every flash chip knows, and starts the
// image behind it. tools/boot2_crc.py adds the CRC the boot ROM checks.
    .syntax unified
    .cpu cortex-m0plus
    .thumb

    .equ SSI, 0x18000000            // datasheet 4.10.13
    .equ CTRLR0, 0x00
    .equ CTRLR1, 0x04
    .equ SSIENR, 0x08
    .equ BAUDR, 0x14
    .equ SPI_CTRLR0, 0xf4
    .equ VTOR, 0xe000ed08
    .equ IMAGE, 0x10000100

    .section .boot2, "ax"
    .global boot2
    .thumb_func
boot2:
    ldr r3, =SSI
    movs r0, #0
    str r0, [r3, #SSIENR]           // settings hold only while disabled
    movs r0, #4
    str r0, [r3, #BAUDR]            // 125 MHz / 4 = 31 MHz; 03h goes to 50 MHz
    ldr r0, =(31 << 16 | 3 << 8)    // 32-bit frames; "EEPROM read": send command and address, then receive
    str r0, [r3, #CTRLR0]
    movs r0, #0
    str r0, [r3, #CTRLR1]           // one frame a read
    ldr r0, =(0x03 << 24 | 2 << 8 | 6 << 2) // command 03h of 8 bits, address of 6 x 4 bits, all on one line
    ldr r1, =(SSI + SPI_CTRLR0)
    str r0, [r1]
    movs r0, #1
    str r0, [r3, #SSIENR]

    ldr r0, =IMAGE                  // its vector table
    ldr r1, =VTOR
    str r0, [r1]
    ldm r0!, {r1, r2}
    msr msp, r1
    bx r2
    .ltorg
